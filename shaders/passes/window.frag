// A Gaussian over straight distances in space, of the blocks of texels around and of those that a list names: stretch,
// shear and borders of the atlas drop out.
#include "lib/fetch.glsl"
#include "lib/rows.glsl"

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 here = fetch(position, texel);
    ivec2 size = textureSize(light, 0);
    vec2 width = 1.0 / vec2(size);
    ivec2 block = texel / p.factor;
    uint bits = word(fetch(reach, block).r);
    int most = (1 << RADIUS_BITS) - 1;
    ivec2 radius = ivec2(int(bits) & most, int(bits >> RADIUS_BITS) & most);
    ivec2 low = max(block - radius, 0), high = min(block + radius, size - 1);
    vec4 sum = vec4(0.0);
    // Loops that end with their test: of others software GL runs the body once more, for nothing.
    int row = low.y;
    do {
        vec2 at = (vec2(low.x, row) + 0.5) * width;
        int column = low.x;
        do {
            vec3 away = textureLod(place, at, 0.0).xyz - here.xyz;
            sum += exp2(-p.falloff * dot(away, away)) * textureLod(light, at, 0.0);
            at.x += width.x;
        } while (++column <= high.x);
    } while (++row <= high.y);
    int list = int(bits >> (2 * RADIUS_BITS));
    int stop = list > 0 ? int(word(at(starts, list).r)) : 0;
    // With w = (1 + n . n') / 2: these may face elsewhere.
    vec3 N = fetch(normal, texel).xyz;
    for (int k = list > 0 ? int(word(at(starts, list - 1).r)) : 0; k < stop; ++k) {
        uint address = word(at(entries, k).r);
        ivec2 source = ivec2(int(address >> ROW_BITS), int(address) & ((1 << ROW_BITS) - 1));
        vec2 there = (vec2(source) + 0.5) * width;
        vec3 away = textureLod(place, there, 0.0).xyz - here.xyz;
        float w = 0.5 + 0.5 * dot(N, textureLod(facing, there, 0.0).xyz);
        sum += w * exp2(-p.falloff * dot(away, away)) * textureLod(light, there, 0.0);
    }
    bool known = here.w > 0.0 && sum.a > 0.0;
    windowed = known ? vec4(sum.rgb / sum.a, 1.0) : vec4(0.0);
}
