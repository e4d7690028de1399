// Entries of a splat: column and row of p.place_bits each, then the weight.
#include "lib/rows.glsl"

vec2 place_of(uint entry) {
    uint mask = (1u << p.place_bits) - 1u;
    return vec2(float(entry & mask), float((entry >> p.place_bits) & mask)) + 0.5;
}

float weight_of(uint entry) {
    return float(entry >> (2 * p.place_bits));
}
