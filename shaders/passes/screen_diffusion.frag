// One direction of a Gaussian in the picture, as wide as its millimeters look at the pixel's depth [Jimenez2009].
// Distances count the difference of depth, so that light keeps to a surface and slants narrow the window.
#include "lib/fetch.glsl"

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float z = fetch(depth, pixel).r;
    vec4 here = fetch(image, pixel);
    if (z <= 0.0) {
        diffused = vec4(0.0);
        return;
    }
    vec2 size = vec2(textureSize(image, 0));
    float pixels = p.scale / z;  // per mm
    float spacing = max(1.0, p.kept * p.sigma * pixels / float(p.taps));
    vec4 sum = here;
    float total = 1.0;
    for (int k = -p.taps; k <= p.taps; ++k) {
        float offset = k == 0 ? 1e9 : floor(float(k) * spacing + 0.5);
        vec2 at = gl_FragCoord.xy + offset * (p.along == 0 ? vec2(1.0, 0.0) : vec2(0.0, 1.0));
        vec2 inside = step(vec2(0.0), at) * step(at, size);
        float there = textureLod(depth, at / size, 0.0).r;
        float away = offset / pixels;
        float dz = there - z;
        float weight = exp(-(away * away + dz * dz) / (2.0 * p.sigma * p.sigma));
        weight *= inside.x * inside.y * step(1e-20, there);
        sum += weight * textureLod(image, at / size, 0.0);
        total += weight;
    }
    diffused = sum / total;
}
