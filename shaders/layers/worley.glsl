#include "lib/band.glsl"
#include "lib/noise.glsl"
#include "lib/site.glsl"

// From x to the feature point of the cell `offset` cells away, in cells.
vec3 worley_point(ivec3 cell, ivec3 offset, vec3 fraction, float jitter, int seed) {
    return vec3(offset) + 0.5 + jitter * (hash_cell(cell + offset, seed).xyz - 0.5) - fraction;
}

// Cellular patterns [Worley1996, "A Cellular Texture Basis Function"], sought among the 27 nearest cells.
float worley_layer(worley_values p, Site site) {
    // Half a cell aside, so that a flat square, where z is 0, cuts through cells and not between them.
    vec3 x = warp_cells(site.position / p.scale + 0.5, p.warp, p.seed);
    vec3 whole = floor(x);
    ivec3 cell = ivec3(whole);
    vec3 fraction = x - whole;

    float nearest_squared = 1e9;
    vec3 nearest = vec3(0.0);
    ivec3 owner = ivec3(0);
    for (int i = 0; i < 27; ++i) {
        ivec3 offset = ivec3(i % 3, (i / 3) % 3, i / 9) - 1;
        vec3 point = worley_point(cell, offset, fraction, p.jitter, p.seed);
        float squared = dot(point, point);
        if (squared < nearest_squared) {
            nearest_squared = squared;
            nearest = point;
            owner = offset;
        }
    }

    float texel = site.footprint / p.scale;
    float t = 0.0;
    if (p.kind == WORLEY_DISTANCE) {
        t = levels(sqrt(nearest_squared), p.levels, texel);
    } else {
        // Distance to the border: the nearest of the planes halfway to the other points, measured along the surface,
        // so that a line keeps its width where it cuts the surface at a slant.
        float border = 1e9;
        float other_value = 0.0;
        for (int i = 0; i < 27; ++i) {
            ivec3 offset = ivec3(i % 3, (i / 3) % 3, i / 9) - 1;
            vec3 point = worley_point(cell, offset, fraction, p.jitter, p.seed);
            vec3 between = point - nearest;
            float away = dot(between, site.normal);
            float across = sqrt(max(dot(between, between) - away * away, 1e-6));
            float distance_to_plane = 0.5 * dot(point + nearest, between) / across;
            if (offset != owner && distance_to_plane < border) {
                border = distance_to_plane;
                other_value = hash_cell(cell + offset, p.seed).w;
            }
        }
        if (p.kind == WORLEY_EDGES) {
            float width = max(p.width, texel);
            t = levels(p.width / width * (1.0 - smoothstep(0.0, width, border)), p.levels, 0.0);
        } else {
            float value = hash_cell(cell + owner, p.seed).w;
            float share = 0.5 * (1.0 - smoothstep(0.0, max(texel, p.width), border));
            t = mix(levels(value, p.levels, 0.0), levels(other_value, p.levels, 0.0), share);
        }
    }
    return mix(p.mean, t, resolved(p.scale, site.footprint));
}
