// As lattice_splat.frag, alone and times the normal's coordinates.
#include "lib/entries.glsl"

void give(vec4 gift, vec3 N) {
    one += gift;
    x += N.x * gift;
    y += N.y * gift;
    z += N.z * gift;
}

void main() {
    int node = own_index();
    one = x = y = z = vec4(0.0);
    if (node >= p.nodes) {
        return;
    }
    int first = int(word(at(starts, 2 * node).r));
    int middle = int(word(at(starts, 2 * node + 1).r));
    int stop = int(word(at(starts, 2 * node + 2).r));
    vec2 scale = 1.0 / vec2(textureSize(light, 0));
    for (int k = first; k < middle; ++k) {
        uint entry = word(at(entries, k).r);
        vec2 place = place_of(entry) * scale;
        give(weight_of(entry) * textureLod(light, place, 0.0), textureLod(facing, place, 0.0).xyz);
    }
    scale = 1.0 / vec2(textureSize(area, 0));
    for (int k = middle; k < stop; ++k) {
        uint entry = word(at(entries, k).r);
        vec2 place = place_of(entry) * scale;
        vec4 gift = textureLod(area, place, 0.0).r * vec4(textureLod(image, place, 0.0).rgb, 1.0);
        give(weight_of(entry) * gift, textureLod(normal, place, 0.0).xyz);
    }
}
