// Each node of the lattice gathers from the texels in whose tetrahedra it is a corner.
#include "lib/rows.glsl"

void main() {
    int node = own_index();
    splat = vec4(0.0);
    if (node >= p.nodes) {
        return;
    }
    int first = int(at(starts, node).r);
    int stop = int(at(starts, node + 1).r);
    vec2 size = vec2(textureSize(source, 0));
    uint mask = (1u << p.texel_bits) - 1u;
    for (int k = first; k < stop; ++k) {
        uint entry = word(at(entries, k).r);
        vec2 place = vec2(float(entry & mask), float((entry >> p.texel_bits) & mask)) + 0.5;
        splat += float(entry >> (2 * p.texel_bits)) * textureLod(source, place / size, 0.0);
    }
}
