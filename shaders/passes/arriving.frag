// What light of the atlas the camera sees.
#include "lib/fetch.glsl"

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 light = texture(image, fetch(uv, pixel).zw);
    bool covered = fetch(depth, pixel).r > 0.0;
    arriving = covered ? vec4(light.rgb / max(light.a, 1e-4), 1.0) : vec4(0.0);
}
