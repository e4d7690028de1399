// What arrives in texture space: ambient and diffuse terms only [Fecko2013, section 4.2.1].
// The mean over the texel, so that the edge of a light is no staircase to be diffused: of its center and corners, which
// is exact where the light bends as a parabola; where they tell of an edge, of p.samples x p.samples places.
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

vec3 P, P_u, P_v, N, N_u, N_v;

// What the surface receives at a place, in texels from the center; and what it would if it faced the light.
vec3 received_at(int kind, Light light, vec2 place, out vec3 arriving) {
    vec3 at = N + place.x * N_u + place.y * N_v;
    at *= inversesqrt(max(dot(at, at), 1e-30));
    Lit lit = light_along(kind, light, light.position - P - (place.x * P_u + place.y * P_v));
    arriving = lit.irradiance;
    return max(dot(at, lit.L), 0.0) * arriving;
}

// The mean over the texel of what it receives of a light.
vec3 mean_of(int kind, Light light) {
    bool whole = p.samples > 1;
    vec3 mean = vec3(0.0);
    vec3 bend = vec3(0.0);
    vec3 brightest = vec3(0.0);
    int places = whole ? 5 : 1;
    for (int i = 0; i < places; ++i) {
        vec2 place = i == 0 ? vec2(0.0) : vec2(i & 1, (i >> 1) & 1) - 0.5;
        vec3 arriving;
        vec3 received = received_at(kind, light, place, arriving);
        mean += (i > 0 ? 1.0 / 12.0 : whole ? 2.0 / 3.0 : 1.0) * received;
        bend += (i > 0 ? -0.25 : 1.0) * arriving;
        brightest = max(brightest, abs(arriving));
    }
    // The light of a directional one is everywhere the same.
    if (kind == DIRECTIONAL) {
        return mean;
    }
    vec3 edge = whole ? clamp(abs(bend) / max(CHANGE * brightest, 1e-30) - 1.0, 0.0, 1.0) : vec3(0.0);
    // A loop costs nothing where no texel of a group needs it, in software, too.
    int side = any(greaterThan(edge, vec3(0.0))) ? p.samples : 0;
    vec3 closely = vec3(0.0);
    for (int i = 0; i < side * side; ++i) {
        vec3 arriving;
        vec2 place = (vec2(i % p.samples, i / p.samples) + 0.5) / float(p.samples) - 0.5;
        closely += received_at(kind, light, place, arriving);
    }
    return mix(mean, closely / float(p.samples * p.samples), edge);
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 owner = fetch(position, texel);
    int slot = int(owner.w);
    vec4 response = p.response[max(slot - 1, 0)];  // x: ambient, y: diffuse factor of the skin
    float covered = slot > 0 ? 1.0 : 0.0;
    P = owner.xyz;
    N = fetch(normal, texel).xyz;
    P_u = P_v = N_u = N_v = vec3(0.0);
    if (p.samples > 1) {
        change(texel, ivec2(1, 0), P, N, P_u, N_u);
        change(texel, ivec2(0, 1), P, N, P_v, N_v);
    }
    vec3 total = vec3(0.0);
    int point = p.directional + p.point;
    int spot = point + p.spot;
    // As above: where there is no surface, loops do not turn.
    int none = slot > 0 ? 0 : spot;
    for (int i = none; i < p.directional; ++i) {
        total += mean_of(DIRECTIONAL, light_at(i));
    }
    for (int i = max(p.directional, none); i < point; ++i) {
        total += mean_of(POINT, light_at(i));
    }
    for (int i = max(point, none); i < spot; ++i) {
        total += mean_of(SPOT, light_at(i));
    }
    irradiance = covered * vec4(response.x * p.ambient + response.y * total, p.covers);
}
