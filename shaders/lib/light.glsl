// Lights without extent: directional, point, spot. The passes that include this declare
//   int p.kind (0 ambient, 1 directional, 2 point, 3 spot); vec3 p.position (mm, relative to the mesh);
//   vec3 p.direction (unit, where the light travels); vec3 p.color; float p.outer, p.inner (1 - cosine at a
//   spot's edge and where its full light begins).
const int AMBIENT = 0;
const int DIRECTIONAL = 1;
const int POINT = 2;
const int SPOT = 3;

// An intensity is stated as the irradiance it gives at 1 m.
const float REFERENCE_DISTANCE = 1000.0;

struct Lit {
    vec3 L;           // unit, towards the light
    vec3 irradiance;  // on a surface that faces the light
};

// Of the light as seen along the way to it, which the caller subtracts so that no digits are lost near the light.
Lit light_along(vec3 to_light) {
    if (p.kind == DIRECTIONAL) {
        return Lit(-p.direction, p.color);
    }
    float distance2 = max(dot(to_light, to_light), 1e-6);
    vec3 L = to_light / sqrt(distance2);
    float falloff = REFERENCE_DISTANCE * REFERENCE_DISTANCE / distance2;
    if (p.kind == SPOT) {
        // Cubic from the cone's edge to where the blend ends. The chord keeps what 1 - cosine would round away in a
        // narrow cone.
        vec3 chord = L + p.direction;
        float blend = max(p.outer - p.inner, max(1e-6 * p.outer, 1e-30));
        float x = clamp((p.outer - 0.5 * dot(chord, chord)) / blend, 0.0, 1.0);
        falloff *= x * x * (3.0 - 2.0 * x);
    }
    return Lit(L, p.color * falloff);
}
