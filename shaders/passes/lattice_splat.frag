// Each node of the lattice gathers from the blocks, and the single texels, in whose tetrahedra it is a corner.
#include "lib/entries.glsl"

void main() {
    int node = own_index();
    splat = vec4(0.0);
    if (node >= p.nodes) {
        return;
    }
    int first = int(word(at(starts, 2 * node).r));
    int middle = int(word(at(starts, 2 * node + 1).r));
    int stop = int(word(at(starts, 2 * node + 2).r));
    vec2 scale = 1.0 / vec2(textureSize(light, 0));
    for (int k = first; k < middle; ++k) {
        uint entry = word(at(entries, k).r);
        splat += weight_of(entry) * textureLod(light, place_of(entry) * scale, 0.0);
    }
    scale = 1.0 / vec2(textureSize(area, 0));
    for (int k = middle; k < stop; ++k) {
        uint entry = word(at(entries, k).r);
        vec2 place = place_of(entry) * scale;
        splat += weight_of(entry) * textureLod(area, place, 0.0).r * vec4(textureLod(image, place, 0.0).rgb, 1.0);
    }
}
