#include "lib/filter.glsl"
#include "lib/marks.glsl"
#include "lib/site.glsl"

// Cosine of five times and of seven times the angle whose cosine is x.
float chromatophores_five(float x) {
    return x * ((16.0 * x * x - 20.0) * x * x + 5.0);
}
float chromatophores_seven(float x) {
    return x * (((64.0 * x * x - 112.0) * x * x + 56.0) * x * x - 7.0);
}

// Share of a place that a sac covers; `pull` is how far its edge is out of round.
float chromatophores_sac(Disk disk, vec3 away, vec3 first, vec3 second, float pull) {
    float distance = sqrt(max(dot(away, away), 1e-12));
    float ragged = 0.6 * chromatophores_five(dot(away, first) / distance)
        + 0.4 * chromatophores_seven(dot(away, second) / distance);
    return disk_at(disk, distance * (1.0 - pull * ragged));
}

// Sacs around the site. What places them and what opens them are
// different numbers, so that they stay where they are.
float chromatophores_layer(chromatophores_values p, Site site) {
    float texel = site.footprint / p.cell;
    float reach = 1.15 * disk_reach(disk_of(p.open, 0.12 * p.open, texel));
    float untouched = 1.0;
    Marks marks = find_marks(site.position / p.cell, site.normal, reach);
    for (ivec3 cell = marks.first; cell.z <= marks.last.z; cell = next_cell(marks, cell)) {
        vec4 hashed = hash_marks(marks, cell, p.period, p.seed);
        for (int which = 0; which < 2; ++which) {
            Mark mark = mark_of(marks, cell, hashed, which, p.jitter, site.normal);
            if (mark.near <= 0.0 || dot(mark.along, mark.along) > reach * reach) {
                continue;
            }
            vec4 random = more_random(mark.random);
            float opened = clamp((1.0 + p.variation) * p.expansion - p.variation * mark.random.w, 0.0, 1.0);
            float radius = mix(p.closed, p.open, opened) * sqrt(mark.near) * (1.0 - 0.5 * p.variation * random.w);
            vec3 first = along_surface(random.xyz - 0.5, site.normal);
            Disk disk = disk_of(radius, 0.12 * radius, texel);
            untouched *= 1.0 - chromatophores_sac(disk, mark.along, first, cross(site.normal, first), 0.15 * opened);
        }
    }
    return 1.0 - untouched;
}
