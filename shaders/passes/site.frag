// Where on the surface each texel of a map lies, and how many millimetres it spans.
#include "lib/bump.glsl"

in vec3 v_position;
in vec3 v_normal;
in vec3 v_dpdu;
in vec3 v_dpdv;

void main() {
    position = vec4(v_position, 1.0);
    normal = vec4(unit_or_zero(v_normal), sqrt(length(cross(v_dpdu, v_dpdv))) * p.texel);
}
