// From several samples a pixel to one: the mean of quantities that mix, the first covered sample of those that do not.
#include "lib/fetch.glsl"

void main() {
    ivec2 corner = ivec2(gl_FragCoord.xy) * p.samples;
    vec4 sum = vec4(0.0);
    vec4 first = vec4(0.0);
    bool found = false;
    for (int y = 0; y < p.samples; ++y) {
        for (int x = 0; x < p.samples; ++x) {
            ivec2 at = corner + ivec2(x, y);
            vec4 value = fetch(image, at);
            sum += value;
            if (!found && fetch(depth, at).r > 0.0) {
                first = value;
                found = true;
            }
        }
    }
    resolved = p.mean == 1 ? sum / float(p.samples * p.samples) : first;
    // Transparent where nothing is; over a background where one is asked for.
    resolved += p.background * (1.0 - resolved.a);
}
