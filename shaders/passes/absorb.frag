// The part of the surface's color that meets light on its way in.
#include "lib/fetch.glsl"

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec3 color = max(fetch(albedo, texel).rgb, 0.0);
    vec4 light = fetch(image, texel);
    absorbed = vec4(light.rgb * (p.way_in == 2 ? color : p.way_in == 1 ? sqrt(color) : vec3(1.0)), light.a);
}
