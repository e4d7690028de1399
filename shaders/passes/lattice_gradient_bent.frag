// Sums at each node and their gradients per half lattice constant: first of all nodes alone, then times the normal's
// coordinates.
#include "lib/rows.glsl"

void take(sampler2D image, int node) {
    vec4 next = at(links, 2 * node);
    vec4 last = at(links, 2 * node + 1);
    vec4 a = at(image, int(next.x)) - at(image, int(last.x));
    vec4 b = at(image, int(next.y)) - at(image, int(last.y));
    vec4 c = at(image, int(next.z)) - at(image, int(last.z));
    vec4 d = at(image, int(next.w)) - at(image, int(last.w));
    sums = at(image, node);
    // The directions of skincli.mesh.lattice, as in lattice_gradient.frag.
    along_x = (a + b + c + d) / 8.0;
    along_y = (a - b + c - d) / 8.0;
    along_z = (a + b - c - d) / 8.0;
}

void main() {
    int index = own_index();
    int factor = index / p.nodes;
    int node = index - factor * p.nodes;
    sums = along_x = along_y = along_z = vec4(0.0);
    // Neighboring texels nearly always take the same way.
    if (factor == 0) {
        take(image_one, node);
    } else if (factor == 1) {
        take(image_x, node);
    } else if (factor == 2) {
        take(image_y, node);
    } else if (factor == 3) {
        take(image_z, node);
    }
}
