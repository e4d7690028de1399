// Second geometry pass: what the camera sees. Depth is linear, along the view axis, in mm; 0 is background.
#include "lib/bump.glsl"

in vec3 v_position;
in vec3 v_normal;
in vec2 v_uv;
in vec2 v_atlas_uv;
in vec3 v_dpdu;
in vec3 v_dpdv;

void main() {
    vec3 N = unit_or_zero(v_normal);
    vec4 texel = texture(slope_map, v_uv);
    vec2 dh = height_slope(texel, v_dpdu, v_dpdv, p.bumpiness);
    depth = vec4(dot(v_position - p.eye, p.forward));
    normal = vec4(bumped_normal(N, v_dpdu, v_dpdv, dh), p.slot);
    uv = vec4(v_uv, v_atlas_uv);
    albedo = vec4(texture(albedo_map, v_uv).rgb, 1.0);
    reflectance = vec4(p.reflectance * texture(reflectance_map, v_uv).r);
    frame_n = vec4(N, 1.0);
    frame_u = vec4(v_dpdu, dh.x);
    frame_v = vec4(v_dpdv, dh.y);
}
