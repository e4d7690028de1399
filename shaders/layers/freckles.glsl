#include "lib/filter.glsl"
#include "lib/marks.glsl"
#include "lib/noise.glsl"
#include "lib/site.glsl"

// Share of the freckles that show, 0.5 in the middle; it may lie outside of 0 to 1.
float freckles_crowd(freckles_values p, Site site) {
    vec3 x = site.position / p.cluster;
    vec3 whole = floor(x);
    float noise = gradient_noise(ivec3(whole), x - whole, p.cluster_period, p.seed + 1);
    return 0.5 + p.clustering * resolved(p.cluster, site.footprint) * noise;
}

float freckles_local(freckles_values p, Site site) {
    return clamp(freckles_crowd(p, site), 0.0, 1.0);
}

// Freckles: small spots of ragged outline, unequal in size and darkness, that come in clusters.
float freckles_layer(freckles_values p, Site site) {
    float texel = site.footprint / p.cell;
    float crowd = freckles_crowd(p, site);
    vec3 x = site.position / p.ragged;
    vec3 whole = floor(x);
    vec3 ragged = p.irregularity * p.radius * resolved(p.ragged, site.footprint)
        * value_noise(ivec3(whole), x - whole, p.ragged_period, p.seed + 2);
    ragged -= dot(ragged, site.normal) * site.normal;
    Disk largest = disk_of(p.edge * p.radius, p.softness * p.radius, texel);
    float reach = disk_reach(largest) + 1.7320508 * p.irregularity * p.radius;
    float untouched = 1.0;
    Marks marks = find_marks(site.position / p.cell, site.normal, reach);
    for (ivec3 cell = marks.first; cell.z <= marks.last.z; cell = next_cell(marks, cell)) {
        vec4 random = hash_marks(marks, cell, p.period, p.seed);
        for (int which = 0; which < 2; ++which) {
            Mark mark = mark_of(marks, cell, random, which, 1.0, site.normal);
            vec4 more = more_random(mark.random);
            float radius = p.radius * (1.0 - p.variation * more.w);
            Disk disk = disk_of(p.edge * radius, p.softness * radius, texel);
            float shows = clamp(4.0 * (crowd - mark.random.w) + 0.5, 0.0, 1.0) * (1.0 - p.variation * more.x);
            untouched *= 1.0 - mark.near * shows * disk_at(disk, length(mark.along + ragged));
        }
    }
    return 1.0 - untouched;
}
