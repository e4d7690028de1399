// One direction of a separable blur with symmetric taps per channel; beyond the image lies nothing (0).
// An average over covered texels only is had by dividing by the blurred coverage: the image's own alpha, or the same
// blur of the coverage alone, kept in another texture because it does not change with the light.
const int NO_DIVISION = 0;
const int BY_ALPHA = 1;
const int BY_COVERAGE = 2;

vec4 read(ivec2 texel, ivec2 size) {
    bool inside = all(greaterThanEqual(texel, ivec2(0))) && all(lessThan(texel, size));
    vec4 value = inside ? texelFetch(image, texel, 0) : vec4(0.0);
    return p.coverage_only == 1 ? vec4(value.w > 0.0 ? 1.0 : 0.0) : value;
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(image, 0);
    ivec2 direction = ivec2(p.step_x, p.step_y);
    vec4 sum = p.taps[0] * read(texel, size);
    for (int k = 1; k <= p.radius; ++k) {
        sum += p.taps[k] * (read(texel + k * direction, size) + read(texel - k * direction, size));
    }
    if (p.division == BY_ALPHA) {
        bool known = sum.a > p.least_coverage;
        sum = known ? vec4(sum.rgb / sum.a, 1.0) : vec4(vec3(p.empty), 0.0);
    } else if (p.division == BY_COVERAGE) {
        vec3 share = texelFetch(coverage, texel, 0).rgb;
        bool known = min(share.r, min(share.g, share.b)) > p.least_coverage;
        sum = known ? vec4(sum.rgb / share, 1.0) : vec4(vec3(p.empty), 0.0);
    }
    // A second kernel of the same atlas (another skin) overwrites only its own texels.
    if (p.slot > 0 && int(texelFetch(owner, texel, 0).w) != p.slot) {
        discard;
    }
    blurred = sum;
}
