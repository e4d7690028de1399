// Phong highlights, apart from the light that enters the skin [Fecko2013, section 3.1].
#include "lib/fetch.glsl"
#include "lib/light.glsl"
#include "lib/camera.glsl"

// log(1 - x) for 0 <= x < 1; the series keeps what 1 - x would round away.
float log_of_rest(float x) {
    float series = -x * (1.0 + x * (1.0 / 2.0 + x * (1.0 / 3.0 + x * (1.0 / 4.0 + x * (1.0 / 5.0 + x / 6.0)))));
    return x < 0.1 ? series : log(max(1.0 - x, 1e-30));
}

// The highlight of one light.
vec3 highlight(Lit lit, vec3 N, vec3 V, float shininess) {
    vec3 R = reflect(-lit.L, N);
    // 1 - cos from the chord between the two: the cosine itself leaves float32 no digits near 1, where highlights are.
    vec3 chord = R - V;
    float versine = 0.5 * dot(chord, chord);
    bool shines = versine < 1.0 && dot(N, lit.L) > 0.0;
    return (shines ? exp(shininess * log_of_rest(versine)) : 0.0) * lit.irradiance;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 N = fetch(normal, pixel);
    int slot = int(N.w);
    if (slot == 0) {
        specular = vec4(0.0);
        return;
    }
    vec4 gloss = fetch(finish, pixel);  // y: strength, z: shininess
    vec3 c = camera_position(pixel, fetch(depth, pixel).r);
    vec3 from_eye = c.x * p.right + c.y * p.up + c.z * p.forward;
    vec3 V = -from_eye / sqrt(max(dot(from_eye, from_eye), 1e-12));
    vec3 at = p.middle + c.x * p.right + c.y * p.up + (c.z - p.middle_depth) * p.forward;
    vec3 total = vec3(0.0);
    for (int i = 0; i < p.directional; ++i) {
        total += highlight(light_along(DIRECTIONAL, light_at(i), vec3(0.0)), N.xyz, V, gloss.z);
    }
    for (int i = p.directional; i < p.directional + p.point; ++i) {
        Light light = light_at(i);
        total += highlight(light_along(POINT, light, light.position - at), N.xyz, V, gloss.z);
    }
    for (int i = p.directional + p.point; i < p.directional + p.point + p.spot; ++i) {
        Light light = light_at(i);
        total += highlight(light_along(SPOT, light, light.position - at), N.xyz, V, gloss.z);
    }
    specular = vec4(p.scale * gloss.y * total, 0.0);
}
