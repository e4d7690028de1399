// Five taps along a line of the lattice. Nodes come in and go out in different orders, so that a line's nodes lie side
// by side when they are read; those that do not exist leave no gap.
#include "lib/rows.glsl"

struct Line {
    ivec4 beside;  // where the nodes two and one before, one and two after are
    int here;
    vec4 weights;  // 0 for one that does not exist
    float weight;
};

Line line_of(float value) {
    uint bits = word(value);
    int place = int(bits & ((1u << LINE_BITS) - 1u));
    ivec4 exists = ivec4((uvec4(bits) >> uvec4(LINE_BITS, LINE_BITS + 1, LINE_BITS + 3, LINE_BITS + 4)) & 1u);
    int here = int((bits >> (LINE_BITS + 2)) & 1u);
    ivec4 beside = place + ivec4(-exists.y - 1, -1, here, here + exists.z);
    return Line(max(beside, ivec4(0)), place, vec4(exists) * vec4(p.far, p.near, p.near, p.far), float(here) * p.middle);
}

vec4 blurred_line(sampler2D image, Line line) {
    return line.weight * at(image, line.here)
        + line.weights.x * at(image, line.beside.x)
        + line.weights.y * at(image, line.beside.y)
        + line.weights.z * at(image, line.beside.z)
        + line.weights.w * at(image, line.beside.w);
}
