// Exposure and tone curve. Input is premultiplied and linear, output is linear light of a display, not premultiplied.
#include "lib/fetch.glsl"
#include "lib/tone.glsl"

void main() {
    vec4 scene = fetch(beauty, ivec2(gl_FragCoord.xy));
    vec3 color = max(scene.rgb / max(scene.a, 1e-6), 0.0) * p.gain;
    displayed = vec4(p.neutral == 1 ? neutral_display(color) : min(color, 1.0), scene.a);
}
