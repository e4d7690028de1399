// What a texel receives: interpolated in its tetrahedron from averages and half their gradients, which cancels the
// error of second order that linear interpolation would leave.
#include "lib/fetch.glsl"
#include "lib/rows.glsl"

void main() {
    vec4 packed_words = fetch(slices, ivec2(gl_FragCoord.xy));
    sliced = vec4(0.0);
    if (packed_words.x == 0.0) {
        return;
    }
    uvec4 words = uvec4(word(packed_words.x), word(packed_words.y), word(packed_words.z), word(packed_words.w));
    uvec4 digits = words >> NODE_BITS;
    ivec4 node = ivec4(words & ((1u << NODE_BITS) - 1u));
    float M = float(digits.y) / PLACE_STEPS;
    float m = float(digits.z) / PLACE_STEPS;
    float n = float(digits.w) / PLACE_STEPS;
    vec4 weight = vec4(1.0 - 0.5 * (M + m), 0.5 * (M - m), 0.5 * (m + n), 0.5 * (m - n));
    vec3 sign = 1.0 - 2.0 * vec3((uvec3(digits.x) >> uvec3(0, 1, 2)) & 1u);
    uint longest = (digits.x >> 4) & 3u;
    bool odd = (digits.x & 8u) != 0u;
    bool bent = digits.x >= BENT;
    vec3 axis = vec3(longest == 0u, longest == 1u, longest == 2u);
    // The axis after x is y: shifting a unit vector to the right names the next axis, to the left the one before.
    vec3 last = odd ? axis.zxy : axis.yzx;
    vec3 offset = sign * (axis * M + (vec3(1.0) - axis - last) * m + last * n);
    mat4 from = mat4(
        vec4(1.0, 0.5 * offset),
        vec4(1.0, 0.5 * (offset - 2.0 * sign * axis)),
        vec4(1.0, 0.5 * (offset - sign)),
        vec4(1.0, 0.5 * (offset - sign + 2.0 * sign * last))
    );
    vec3 sum = vec3(0.0);
    // Loops of no turns rather than branches: software GL skips them.
    for (int k = 0; k < (bent ? 0 : 4); ++k) {
        vec4 weights = weight[k] * from[k];
        sum += vec3(dot(weights, at(red, node[k])), dot(weights, at(green, node[k])), dot(weights, at(blue, node[k])));
    }
    // Where normals differ, with w = (1 + n . n') / 2, which is of rank four: so that light on the one side of an ear
    // does not reach the other side.
    vec4 total = vec4(0.0);
    vec3 N = fetch(normal, ivec2(gl_FragCoord.xy)).xyz;
    for (int k = 0; k < (bent ? 4 : 0); ++k) {
        vec4 turned = N.x * at(x, node[k]) + N.y * at(y, node[k]) + N.z * at(z, node[k]);
        total += weight[k] * (at(one, node[k]) + turned);
    }
    sum += total.a > 0.0 ? total.rgb / total.a : vec3(0.0);
    sliced = vec4(p.weight * sum, p.share);
}
