// One of the four directions of the lattice.
#include "lib/line.glsl"

void main() {
    int node = own_index();
    blurred = node < p.nodes ? blurred_line(image, word(at(lines, node).r)) : vec4(0.0);
}
