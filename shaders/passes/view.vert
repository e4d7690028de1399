in vec3 in_position;
in vec3 in_normal;
in vec2 in_uv;
in vec2 in_atlas_uv;
in vec3 in_dpdu;
in vec3 in_dpdv;

out vec3 v_position;
out vec3 v_normal;
out vec2 v_uv;
out vec2 v_atlas_uv;
out vec3 v_dpdu;
out vec3 v_dpdv;

void main() {
    v_position = in_position;
    v_normal = in_normal;
    v_uv = in_uv;
    v_atlas_uv = in_atlas_uv;
    v_dpdu = in_dpdu;
    v_dpdv = in_dpdv;
    gl_Position = p.clip * vec4(in_position, 1.0);
}
