// Blend modes of two values in 0 to 1, backdrop b and source s, in linear light [W3C2024, "Compositing and Blending"].
// The results lie in 0 to 1, so nothing is clamped. Twins: skincli/layers/blend.py.

float blend_normal(float b, float s) { return s; }
vec3 blend_normal(vec3 b, vec3 s) { return s; }

float blend_multiply(float b, float s) { return b * s; }
vec3 blend_multiply(vec3 b, vec3 s) { return b * s; }

float blend_screen(float b, float s) { return b + s - b * s; }
vec3 blend_screen(vec3 b, vec3 s) { return b + s - b * s; }

float blend_overlay(float b, float s) { return b <= 0.5 ? 2.0 * b * s : 1.0 - 2.0 * (1.0 - b) * (1.0 - s); }
vec3 blend_overlay(vec3 b, vec3 s) {
    return vec3(blend_overlay(b.x, s.x), blend_overlay(b.y, s.y), blend_overlay(b.z, s.z));
}
