// A sum of Gaussians, each a level, weighted by the skin that owns the texel and by its scattering radius there.
#include "lib/fetch.glsl"

vec3 sum, kept, place;
int slot;

// Adds what one level gives: level 0 is the light that stays.
void add(int level, vec4 light) {
    // Where a level reaches nothing, light stays: constants pass everywhere.
    vec3 value = light.a > p.least ? light.rgb / light.a : kept;
    int row = level * p.slots + slot - 1;
    ivec2 size = textureSize(weights, 0);
    vec3 weight = texelFetch(weights, ivec2(0, row), 0).rgb;
    for (int c = 0; c < (size.x > 1 ? 3 : 0); ++c) {
        int column = min(int(place[c]), max(size.x - 2, 0));
        float low = texelFetch(weights, ivec2(column, row), 0)[c];
        float high = texelFetch(weights, ivec2(min(column + 1, size.x - 1), row), 0)[c];
        weight[c] = mix(low, high, place[c] - float(column));
    }
    sum += weight * value;
}

// void add_levels(ivec2 texel), which adds the other levels; written by skincli/passes/combine.py
#include "generated/levels.glsl"

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    slot = int(fetch(owner, texel).w);
    if (slot == 0) {
        blurred = vec4(0.0);
        return;
    }
    vec4 light = fetch(image, texel);
    kept = light.rgb;
    vec3 ratio = fetch(spread, texel).rgb;
    place = clamp(ratio * ratio / (p.most * p.most), 0.0, 1.0) * float(textureSize(weights, 0).x - 1);
    sum = vec3(0.0);
    add(0, light);
    add_levels(texel);
    blurred = vec4(sum, 1.0);
}
