// Exposure and tone curve. Input is premultiplied and linear, output is linear light of a display, not premultiplied.
#include "lib/fetch.glsl"
#include "lib/tone.glsl"

void main() {
    vec4 scene = fetch(beauty, ivec2(gl_FragCoord.xy));
    // What is brighter shows as white all the same, and its products stay within float32.
    float brightest = 1e30 / max(p.gain, 1.0);
    vec3 color = clamp(scene.rgb / max(scene.a, 1e-6), 0.0, brightest) * p.gain;
    displayed = vec4(p.neutral == 1 ? neutral_display(color) : min(color, 1.0), scene.a);
}
