// Five taps along a line of the lattice. Nodes come in and go out in different orders, so that a line's nodes lie side
// by side when they are read.
#include "lib/rows.glsl"

struct Line {
    int here;
    vec4 weights;  // of the nodes two and one before, one and two after; 0 for one that does not exist
};

Line line_of(float value) {
    uint bits = word(value);
    vec4 exists = vec4((uvec4(bits) >> uvec4(LINE_BITS, LINE_BITS + 1, LINE_BITS + 3, LINE_BITS + 4)) & 1u);
    return Line(int(bits & ((1u << LINE_BITS) - 1u)), exists * vec4(p.far, p.near, p.near, p.far));
}

vec4 blurred_line(sampler2D image, Line line) {
    return p.middle * at(image, line.here)
        + line.weights.x * at(image, max(line.here - 2, 0))
        + line.weights.y * at(image, max(line.here - 1, 0))
        + line.weights.z * at(image, line.here + 1)
        + line.weights.w * at(image, line.here + 2);
}
