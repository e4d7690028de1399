// What each texel gives to a lattice: its irradiance times its area, and its area.
#include "lib/fetch.glsl"

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float dA = fetch(area, texel).r;
    source = vec4(fetch(image, texel).rgb * dA, dA);
}
