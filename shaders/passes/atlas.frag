// Texture-space G-buffer: position and bumped normal of the surface point that owns the texel.
#include "lib/bump.glsl"

in vec3 v_position;
in vec3 v_normal;
in vec2 v_uv;
in vec3 v_dpdu;
in vec3 v_dpdv;

void main() {
    vec3 N = unit_or_zero(v_normal);
    vec4 texel = texture(slope, v_uv);
    vec2 dh = height_slope(texel, v_dpdu, v_dpdv, p.bumpiness);
    position = vec4(v_position, p.slot);
    normal = vec4(bumped_normal(N, v_dpdu, v_dpdv, dh), 1.0);
    frame_n = vec4(N, 1.0);
    frame_u = vec4(v_dpdu, dh.x);
    frame_v = vec4(v_dpdv, dh.y);
    vec3 along = dFdx(v_position);
    vec3 across = dFdy(v_position);
    metric = vec4(p.gives * length(cross(along, across)), 1.0 / max(vec2(length(along), length(across)), 1e-6), 1.0);
    albedo = vec4(texture(albedo_map, v_uv).rgb, 1.0);
    spread = vec4(texture(radius_map, v_uv).rgb / p.radius, 1.0);
}
