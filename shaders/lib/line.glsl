// Taps along a line of the lattice. Nodes come in and go out in different orders, so that a line's nodes lie side by
// side when they are read; those that do not exist leave no gap.
#include "lib/rows.glsl"

vec4 blurred_line(sampler2D image, uint line) {
    int next = int(line & ((1u << LINE_BITS) - 1u));
    vec4 total = vec4(0.0);
    for (int k = -REACH; k <= REACH; ++k) {
        int there = int((line >> (LINE_BITS + REACH + k)) & 1u);
        total += float(there) * p.weights[abs(k)] * at(image, next);
        next += there;
    }
    return total;
}
