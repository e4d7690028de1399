// Blocks of texels as one source each: what light they give, over which area, and where they lie.
#include "lib/fetch.glsl"

void main() {
    ivec2 corner = ivec2(gl_FragCoord.xy) * p.factor;
    ivec2 size = textureSize(area, 0);
    light = vec4(0.0);
    place = vec4(0.0);
    facing = vec4(0.0);
    for (int y = 0; y < p.factor; ++y) {
        for (int x = 0; x < p.factor; ++x) {
            ivec2 texel = corner + ivec2(x, y);
            float dA = all(lessThan(texel, size)) ? fetch(area, texel).r : 0.0;
            light += dA * vec4(fetch(image, texel).rgb, 1.0);
            place += dA * fetch(position, texel);
            facing += dA * fetch(normal, texel);
        }
    }
    float share = light.a > 0.0 ? 1.0 / light.a : 0.0;
    place *= share;
    facing *= share;
}
