// One direction of a separable blur with symmetric taps per channel; beyond the image lies nothing (0).
// An average over covered texels only is had by dividing by the blurred coverage: the image's own alpha, which is then
// known only where the owner is covered; or the same blur of the coverage alone, kept in another texture because it
// does not change with the light, which also continues the image beyond its charts.
#include "lib/fetch.glsl"

const int NO_DIVISION = 0;
const int BY_ALPHA = 1;
const int BY_COVERAGE = 2;

vec4 read(vec2 at) {
    // On software GL a nearest read by coordinate costs less than half of a texelFetch.
    vec4 value = textureLod(image, at, 0.0);
    return p.coverage_only == 1 ? vec4(value.w > 0.0 ? 1.0 : 0.0) : value;
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec2 size = vec2(textureSize(image, 0));
    vec2 at = gl_FragCoord.xy / size;
    vec2 step = vec2(p.step_x, p.step_y) / size;
    vec4 sum = p.taps[0] * read(at);
    for (int k = 1; k <= p.radius; ++k) {
        sum += p.taps[k] * (read(at + float(k) * step) + read(at - float(k) * step));
    }
    if (p.division == BY_ALPHA) {
        bool known = sum.a > p.least_coverage && fetch(owner, texel).w > 0.0;
        sum = known ? vec4(sum.rgb / sum.a, 1.0) : vec4(vec3(p.empty), 0.0);
    } else if (p.division == BY_COVERAGE) {
        vec3 share = fetch(coverage, texel).rgb;
        bool known = min(share.r, min(share.g, share.b)) > p.least_coverage;
        sum = known ? vec4(sum.rgb / share, 1.0) : vec4(vec3(p.empty), 0.0);
    }
    // A second kernel of the same atlas (another skin) overwrites only its own texels.
    if (p.slot > 0 && int(fetch(owner, texel).w) != p.slot) {
        discard;
    }
    blurred = sum;
}
