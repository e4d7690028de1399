// One additive pass per light in texture space: ambient and diffuse terms only [Fecko2013, section 4.2.1].
#include "lib/fetch.glsl"
#include "lib/light.glsl"

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 P = fetch(position, texel);
    int slot = int(P.w);
    vec4 response = p.response[max(slot - 1, 0)];  // x: ambient, y: diffuse factor of the skin
    float covered = slot > 0 ? 1.0 : 0.0;
    if (p.kind == AMBIENT) {
        irradiance = covered * vec4(p.color * response.x, 1.0);
        return;
    }
    vec3 N = fetch(normal, texel).xyz;
    Lit lit = light_at(P.xyz);
    irradiance = vec4(covered * response.y * max(dot(N, lit.L), 0.0) * lit.irradiance, 0.0);
}
