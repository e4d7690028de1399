// One direction of a separable blur with symmetric taps per channel; beyond the image lies nothing (0).
// An average over what is there is had by dividing by the image's own blurred alpha; it is then known only where the
// owner is covered.
#include "lib/fetch.glsl"

const int NO_DIVISION = 0;
const int BY_ALPHA = 1;

vec4 read(vec2 at) {
    // On software GL a nearest read by coordinate costs less than half of a texelFetch.
    return textureLod(image, at, 0.0);
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
    }
    // A second kernel of the same atlas (another skin) overwrites only its own texels.
    if (p.slot > 0 && int(fetch(owner, texel).w) != p.slot) {
        discard;
    }
    blurred = sum;
}
