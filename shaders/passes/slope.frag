// Slope of the height map by central differences, in mm per unit of uv, beside the slopes of normal maps.
// The map repeats beyond its border, as authored uv may.
#include "lib/fetch.glsl"

float height_at(ivec2 texel, ivec2 size) {
    return texelFetch(height, (texel + size) % size, 0).r;
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(height, 0);
    vec2 dh = vec2(height_at(texel + ivec2(1, 0), size) - height_at(texel - ivec2(1, 0), size),
                   height_at(texel + ivec2(0, 1), size) - height_at(texel - ivec2(0, 1), size));
    slope = vec4(0.5 * vec2(size) * dh, fetch(tangent_slope, texel).xy);
}
