// One additive pass per light in texture space: ambient and diffuse terms only [Fecko2013, section 4.2.1].
// The mean over p.samples x p.samples places in the texel, so that the edge of a light is no staircase to be diffused.
#include "lib/fetch.glsl"
#include "lib/light.glsl"

// By how much position and normal change from texel to texel: towards the neighbor ahead, unless it is so far that it
// must lie beyond a border of the chart.
void change(ivec2 texel, ivec2 step, vec3 P, vec3 N, out vec3 dP, out vec3 dN) {
    ivec2 last = textureSize(position, 0) - 1;
    ivec2 ahead = min(texel + step, last);
    ivec2 behind = max(texel - step, ivec2(0));
    vec4 after = fetch(position, ahead);
    vec4 before = fetch(position, behind);
    float forth = after.w > 0.0 && ahead != texel ? distance(after.xyz, P) : 1e30;
    float back = before.w > 0.0 && behind != texel ? distance(before.xyz, P) : 1e30;
    dP = dN = vec3(0.0);
    if (min(forth, back) < 1e30) {
        bool on = forth <= 2.0 * back;
        dP = on ? after.xyz - P : P - before.xyz;
        dN = on ? fetch(normal, ahead).xyz - N : N - fetch(normal, behind).xyz;
    }
}

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
    vec3 P_u = vec3(0.0);
    vec3 P_v = vec3(0.0);
    vec3 N_u = vec3(0.0);
    vec3 N_v = vec3(0.0);
    if (p.samples > 1) {
        change(texel, ivec2(1, 0), P.xyz, N, P_u, N_u);
        change(texel, ivec2(0, 1), P.xyz, N, P_v, N_v);
    }
    vec3 sum = vec3(0.0);
    for (int y = 0; y < p.samples; ++y) {
        for (int x = 0; x < p.samples; ++x) {
            vec2 place = (vec2(x, y) + 0.5) / float(p.samples) - 0.5;
            vec3 at = N + place.x * N_u + place.y * N_v;
            at *= inversesqrt(max(dot(at, at), 1e-30));
            Lit lit = light_at(P.xyz + place.x * P_u + place.y * P_v);
            sum += max(dot(at, lit.L), 0.0) * lit.irradiance;
        }
    }
    irradiance = vec4(covered * response.y / float(p.samples * p.samples) * sum, 0.0);
}
