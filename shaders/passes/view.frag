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
    // The exponent whose lobe is as wide as a microfacet surface's of that roughness: alpha = roughness^2 and
    // shininess = 2 / alpha^2 - 2.
    float alpha = max(texture(roughness_map, v_uv).r, 0.06);
    alpha *= alpha;
    float shininess = p.shininess >= 0.0 ? p.shininess : max(2.0 / (alpha * alpha) - 2.0, 0.0);
    float strength = p.specular * texture(specular_map, v_uv).r;
    finish = vec4(p.reflectance * texture(reflectance_map, v_uv).r, strength, shininess, 0.0);
    frame_n = vec4(N, 1.0);
    frame_u = vec4(v_dpdu, dh.x);
    frame_v = vec4(v_dpdv, dh.y);
}
