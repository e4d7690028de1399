// Where on the surface each texel of a map lies, and how many millimetres it spans.
#include "lib/bump.glsl"

in vec3 v_position;
in vec3 v_normal;
in vec3 v_dpdu;
in vec3 v_dpdv;
in vec2 v_baked;

void main() {
    vec3 N = unit_or_zero(v_normal);
    vec3 T = unit_or_zero(v_dpdu);
    position = vec4(v_position, 1.0);
    normal = vec4(N, sqrt(length(cross(v_dpdu, v_dpdv))) * p.texel);
    baked = vec4(v_baked, 0.0, 0.0);
    metric = vec4(length(v_dpdu), dot(v_dpdv, T), dot(v_dpdv, cross(N, T)), 0.0);
}
