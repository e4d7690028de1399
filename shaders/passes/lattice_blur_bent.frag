// As lattice_blur.frag, for the sums alone and times the normal's coordinates.
#include "lib/line.glsl"

void main() {
    int node = own_index();
    one = x = y = z = vec4(0.0);
    if (node >= p.nodes) {
        return;
    }
    uint line = word(at(lines, node).r);
    one = blurred_line(image_one, line);
    x = blurred_line(image_x, line);
    y = blurred_line(image_y, line);
    z = blurred_line(image_z, line);
}
