// The maps' own texture space: every vertex goes to its authored uv, moved into the unit square.
in vec3 in_position;
in vec3 in_normal;
in vec2 in_uv;
in vec3 in_dpdu;
in vec3 in_dpdv;
in vec2 in_baked;
in vec2 in_offset;

out vec3 v_position;
out vec3 v_normal;
out vec3 v_dpdu;
out vec3 v_dpdv;
out vec2 v_baked;

void main() {
    vec2 offset = in_offset * p.gutter;
    v_position = in_position + offset.x * in_dpdu + offset.y * in_dpdv;
    v_normal = in_normal;
    v_dpdu = in_dpdu;
    v_dpdv = in_dpdv;
    v_baked = in_baked;
    gl_Position = vec4((in_uv + offset) * 2.0 - 1.0, 0.0, 1.0);
}
