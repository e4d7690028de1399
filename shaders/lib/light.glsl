// Lights without extent: directional, point, spot. The passes that include this declare
//   vec4 p.lights[]: three of each light, see skincli/passes/irradiance.py, those of one kind after another;
//   int p.directional, p.point, p.spot: how many there are of each.
const int DIRECTIONAL = 1;
const int POINT = 2;
const int SPOT = 3;

// An intensity is stated as the irradiance it gives at 1 m.
const float REFERENCE_DISTANCE = 1000.0;

struct Light {
    vec3 color;      // irradiance of a directional light; intensity of the others
    vec3 position;   // mm, relative to the mesh
    float outer;     // 1 - cosine at a spot's edge
    vec3 direction;  // unit, where the light travels
    float inner;     // 1 - cosine where a spot's full light begins
};

struct Lit {
    vec3 L;           // unit, towards the light
    vec3 irradiance;  // on a surface that faces the light
};

Light light_at(int number) {
    vec4 position = p.lights[3 * number + 1];
    vec4 direction = p.lights[3 * number + 2];
    return Light(p.lights[3 * number].xyz, position.xyz, position.w, direction.xyz, direction.w);
}

// Of a light as seen along the way to it, which the caller subtracts so that no digits are lost near the light. The kind
// is to be constant: software GL takes every way through a shader that it cannot leave out before.
Lit light_along(int kind, Light light, vec3 to_light) {
    if (kind == DIRECTIONAL) {
        return Lit(-light.direction, light.color);
    }
    float distance2 = max(dot(to_light, to_light), 1e-6);
    vec3 L = to_light / sqrt(distance2);
    float falloff = REFERENCE_DISTANCE * REFERENCE_DISTANCE / distance2;
    if (kind == SPOT) {
        // Cubic from the cone's edge to where the blend ends. The chord keeps what 1 - cosine would round away in a
        // narrow cone.
        vec3 chord = L + light.direction;
        float blend = max(light.outer - light.inner, max(1e-6 * light.outer, 1e-30));
        float x = clamp((light.outer - 0.5 * dot(chord, chord)) / blend, 0.0, 1.0);
        falloff *= x * x * (3.0 - 2.0 * x);
    }
    return Lit(L, light.color * falloff);
}
