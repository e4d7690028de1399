// What a texel receives: interpolated in its tetrahedron from averages and half their gradients, which cancels the
// error of second order that linear interpolation would leave.
#include "lib/fetch.glsl"
#include "lib/rows.glsl"

// The node one diagonal step away; one that only borders on those with links stands for its neighbors.
int beside(int node, vec3 step) {
    vec4 found = at(links, 2 * min(node, p.nodes - 1) + (step.x < 0.0 ? 1 : 0));
    bool y = step.x * step.y < 0.0;
    bool z = step.x * step.z < 0.0;
    float number = z ? (y ? found.w : found.z) : (y ? found.y : found.x);
    return node < p.nodes ? int(number) : node;
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float packed_word = fetch(slices, texel).r;
    sliced = vec4(0.0);
    if (packed_word == 0.0) {
        return;
    }
    uint bits = word(packed_word);
    bool bent = (bits & BENT) != 0u;
    int own = int(bits & ((1u << NODE_BITS) - 1u));
    // The even node nearest to the texel, of which the tables tell the parity: on a tie between two it decides.
    vec3 place = fetch(position, texel).xyz / p.half_spacing;
    vec3 parity = vec3((uvec3(bits) >> uvec3(NODE_BITS, NODE_BITS + 1, NODE_BITS + 2)) & 1u);
    vec3 base = 4.0 * floor(0.25 * place - 0.5 * parity + 0.5) + 2.0 * parity;
    vec3 offset = clamp(place - base, -1.0, 1.0);
    vec3 sign = mix(vec3(1.0), vec3(-1.0), lessThan(offset, vec3(0.0)));
    vec3 size = abs(offset);
    bool x_longest = size.x >= size.y && size.x >= size.z;
    bool y_longest = !x_longest && size.y >= size.z;
    bool z_shortest = size.z <= size.y && size.z <= size.x;
    bool y_shortest = !z_shortest && size.y <= size.x;
    vec3 longest = vec3(x_longest, y_longest, !x_longest && !y_longest);
    vec3 shortest = vec3(!z_shortest && !y_shortest, y_shortest, z_shortest);
    float M = dot(longest, size);
    float n = dot(shortest, size);
    float m = size.x + size.y + size.z - M - n;
    vec4 weight = vec4(1.0 - 0.5 * (M + m), 0.5 * (M - m), 0.5 * (m + n), 0.5 * (m - n));
    longest *= 2.0 * sign;
    shortest *= 2.0 * sign;
    int across = beside(own, sign);
    ivec4 node = ivec4(own, beside(across, longest - sign), across, beside(own, sign - shortest));
    // Where rounding chooses the tetrahedron next door, a node that no texel reads has next to no weight: it gets none.
    weight *= vec4(lessThan(node, ivec4(bent ? p.bent : p.nodes)));
    mat4 from = mat4(
        vec4(1.0, 0.5 * offset),
        vec4(1.0, 0.5 * (offset - longest)),
        vec4(1.0, 0.5 * (offset - sign)),
        vec4(1.0, 0.5 * (offset - sign + shortest))
    );
    vec4 sum = vec4(0.0);
    // Loops of no turns rather than branches: software GL skips them.
    for (int k = 0; k < (bent ? 0 : 4); ++k) {
        vec4 r = at(red, node[k]);
        vec4 weights = (r.x == NONE ? 0.0 : weight[k]) * from[k];
        sum += vec4(dot(weights, r), dot(weights, at(green, node[k])), dot(weights, at(blue, node[k])), weights.x);
    }
    // Where normals differ, with w = (1 + n . n') / 2, which is of rank four: so that light on the one side of an ear
    // does not reach the other side.
    vec4 total = vec4(0.0);
    vec4 factors = vec4(1.0, fetch(normal, texel).xyz);
    for (int k = 0; k < (bent ? 16 : 0); ++k) {
        int corner = k >> 2;
        int place = (k & 3) * p.bent + node[corner];
        mat4 sum_and_change = mat4(at(sums, place), at(along_x, place), at(along_y, place), at(along_z, place));
        total += weight[corner] * factors[k & 3] * (sum_and_change * from[corner]);
    }
    sum += total.a > 0.0 ? vec4(total.rgb / total.a, 1.0) : vec4(0.0);
    sliced = sum * vec4(p.weight, p.share);
}
