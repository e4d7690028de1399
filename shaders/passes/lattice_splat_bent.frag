// As lattice_splat.frag, alone and times the normal's coordinates.
#include "lib/rows.glsl"

void main() {
    int node = own_index();
    one = x = y = z = vec4(0.0);
    if (node >= p.nodes) {
        return;
    }
    int first = int(at(starts, node).r);
    int stop = int(at(starts, node + 1).r);
    vec2 size = vec2(textureSize(source, 0));
    uint mask = (1u << p.texel_bits) - 1u;
    for (int k = first; k < stop; ++k) {
        uint entry = word(at(entries, k).r);
        vec2 place = (vec2(float(entry & mask), float((entry >> p.texel_bits) & mask)) + 0.5) / size;
        vec4 gift = float(entry >> (2 * p.texel_bits)) * textureLod(source, place, 0.0);
        vec3 N = textureLod(normal, place, 0.0).xyz;
        one += gift;
        x += N.x * gift;
        y += N.y * gift;
        z += N.z * gift;
    }
}
