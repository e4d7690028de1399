// One level of a sum of Gaussians, weighted by the skin that owns the texel and by its scattering radius there.
#include "lib/fetch.glsl"

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    int slot = int(fetch(owner, texel).w);
    if (slot == 0) {
        blurred = vec4(0.0);
        return;
    }
    vec4 light = fetch(term, texel);
    // Where a level reaches nothing, light stays: constants pass everywhere.
    vec3 value = light.a > p.least ? light.rgb / light.a : fetch(image, texel).rgb;
    ivec2 size = textureSize(weights, 0);
    vec3 ratio = fetch(spread, texel).rgb;
    vec3 place = clamp(ratio * ratio / (p.most * p.most), 0.0, 1.0) * float(size.x - 1);
    int row = p.level * p.slots + slot - 1;
    vec3 weight = texelFetch(weights, ivec2(0, row), 0).rgb;
    for (int c = 0; c < (size.x > 1 ? 3 : 0); ++c) {
        int column = min(int(place[c]), max(size.x - 2, 0));
        float low = texelFetch(weights, ivec2(column, row), 0)[c];
        float high = texelFetch(weights, ivec2(min(column + 1, size.x - 1), row), 0)[c];
        weight[c] = mix(low, high, place[c] - float(column));
    }
    blurred = vec4(weight * value, p.level == 0 ? 1.0 : 0.0);
}
