#include "lib/filter.glsl"
#include "lib/marks.glsl"
#include "lib/noise.glsl"
#include "lib/site.glsl"

// Freckles: small spots of ragged outline, unequal in size and darkness, that come in clusters.
float freckles_point(freckles_values p, Site site) {
    float texel = mark_texel(site.footprint, p.cell);
    vec3 x = site.position / p.cluster;
    vec3 whole = floor(x);
    float crowd = 0.5 + p.clustering * gradient_noise(ivec3(whole), x - whole, p.cluster_period, p.seed + 1);
    x = site.position / p.ragged;
    whole = floor(x);
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

float freckles_layer(freckles_values p, Site site) {
    float visible = marks_resolved(site.footprint / p.cell);
    int count = visible > 0.0 ? places_of(site.footprint, p.finest, MARK_PLACES) : 0;
    Site place = site;
    place.footprint /= float(max(count, 1));
    float sum = 0.0;
    for (int i = 0; i < count * count; ++i) {
        place.position = site.position + place_in_texel(site.normal, site.footprint, i, count);
        sum += freckles_point(p, place);
    }
    return mix(p.mean, sum / float(max(count * count, 1)), visible);
}
