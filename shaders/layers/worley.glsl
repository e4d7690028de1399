#include "lib/band.glsl"
#include "lib/filter.glsl"
#include "lib/hash.glsl"
#include "lib/site.glsl"

// A line's profile has 0.11 of the squared half width as variance, a texel 1/12.
const float WORLEY_LINE_PER_TEXEL = 0.8706;

// From `fraction` in a cell to the feature point of the i-th of the 27 cells around, in cells; and a random number.
vec4 worley_feature(worley_values p, ivec3 cell, vec3 fraction, int i) {
    ivec3 offset = ivec3(i % 3, (i / 3) % 3, i / 9) - 1;
    vec4 random = hash_cell(wrap_cell(cell + offset, p.period), p.seed);
    return vec4(vec3(offset) + 0.5 + p.jitter * (random.xyz - 0.5) - fraction, random.w);
}

// Cellular patterns [Worley1996, "A Cellular Texture Basis Function"], sought among the 27 nearest cells.
float worley_layer(worley_values p, Site site) {
    // Aside of the lattice, so that a flat square, where z is 0, cuts cells as any other plane does.
    vec3 x = site.position / p.scale + vec3(0.5, 0.5, 0.25);
    vec3 whole = floor(x);
    ivec3 cell = ivec3(whole);
    vec3 fraction = x - whole;
    float texel = site.footprint / p.scale;

    float first = 1e9;
    float second = 1e9;
    vec4 nearest = vec4(0.0);
    int owner = 0;
    for (int i = 0; i < 27; ++i) {
        vec4 point = worley_feature(p, cell, fraction, i);
        float squared = dot(point.xyz, point.xyz);
        bool nearer = squared < first;
        nearest = nearer ? point : nearest;
        owner = nearer ? i : owner;
        second = min(second, max(first, squared));
        first = min(first, squared);
    }
    if (p.kind == WORLEY_F1 || p.kind == WORLEY_F2 || p.kind == WORLEY_F2_F1) {
        // The mean distance over a texel is a little more than that of its center.
        float near = sqrt(first + texel * texel / 12.0);
        float next = sqrt(second + texel * texel / 12.0);
        float t = p.kind == WORLEY_F1 ? near : p.kind == WORLEY_F2 ? next : next - near;
        return levels(t / p.far, p.levels, EDGE_PER_TEXEL * texel / p.far);
    }

    // Distance to the border: the nearest of the planes halfway to the other points, measured along the surface, so
    // that a line keeps its width where it cuts the surface at a slant.
    float border = 1e9;
    float width = max(length(vec2(p.width, EDGE_PER_TEXEL * texel)), 1e-6);
    float sum = levels(nearest.w, p.levels, 0.0);
    float total = 1.0;
    for (int i = 0; i < 27; ++i) {
        // Hashed again: an array of the points takes twice as long.
        vec4 point = worley_feature(p, cell, fraction, i);
        vec3 between = point.xyz - nearest.xyz;
        float away = dot(between, site.normal);
        float across = sqrt(max(dot(between, between) - away * away, 1e-6));
        float distance_to_plane = i == owner ? 1e9 : 0.5 * dot(point.xyz + nearest.xyz, between) / across;
        border = min(border, distance_to_plane);
        if (p.kind == WORLEY_PATCHES && distance_to_plane < width) {
            // On the border to another cell its value weighs as much as the own.
            float share = 0.5 - 0.5 * smoothstep(0.0, width, distance_to_plane);
            float weight = share / (1.0 - share);
            sum += weight * levels(point.w, p.levels, 0.0);
            total += weight;
        }
    }
    if (p.kind == WORLEY_PATCHES) {
        return sum / total;
    }
    width = length(vec2(p.width, WORLEY_LINE_PER_TEXEL * texel));
    // A line that is widened is so much weaker, against what the levels make of no line.
    float line = levels(1.0 - smoothstep(0.0, width, border), p.levels, 0.0);
    return mix(levels(0.0, p.levels, 0.0), line, p.width / width);
}
