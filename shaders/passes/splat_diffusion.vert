// A point of the surface as a quad that holds the disc which its light reaches: in_normal is the quad's corner.
in vec3 in_position;
in vec3 in_normal;
in vec2 in_atlas_uv;

out vec3 v_center;
out vec2 v_atlas_uv;

void main() {
    vec3 from_eye = in_position - p.eye;
    v_center = vec3(dot(from_eye, p.right), dot(from_eye, p.up), dot(from_eye, p.forward));
    v_atlas_uv = in_atlas_uv;
    gl_Position = p.clip * vec4(in_position, 1.0);
    // A sphere seen from the side is a little wider than its radius.
    gl_Position.xy += 1.1 * p.reach * in_normal.xy / p.tan_half;
}
