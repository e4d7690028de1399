// Texture space [dEon2007]: every vertex goes to its place in the light's atlas.
// A gutter vertex (in_offset not zero) lies outside its chart by p.gutter in atlas uv; its attributes are continued
// linearly along the surface, so that bilinear reads at a chart's border meet no hole.
in vec3 in_position;
in vec3 in_normal;
in vec2 in_uv;
in vec2 in_atlas_uv;
in vec3 in_dpdu;
in vec3 in_dpdv;
in vec2 in_offset;

out vec3 v_position;
out vec3 v_normal;
out vec2 v_uv;
out vec3 v_dpdu;
out vec3 v_dpdv;

void main() {
    v_position = in_position;
    v_normal = in_normal;
    v_uv = in_uv;
    v_dpdu = in_dpdu;
    v_dpdv = in_dpdv;
    gl_Position = vec4((in_atlas_uv + in_offset * p.gutter) * 2.0 - 1.0, 0.0, 1.0);
}
