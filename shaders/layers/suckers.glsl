#include "lib/filter.glsl"
#include "lib/marks.glsl"
#include "lib/site.glsl"

// One sucker: `folds` is the depth of its folds, `clear` how much of them the texels show.
float suckers_ring(suckers_values p, Disk rim, Disk cup, Disk hole, vec3 away, vec3 heading, float clear) {
    float distance = sqrt(max(dot(away, away), 1e-12));
    float whole = disk_at(rim, distance);
    float inner = disk_at(cup, distance);
    float pit = disk_at(hole, distance);
    float own = whole - 0.65 * inner - 0.35 * pit;
    if (p.part == SUCKERS_RIM) {
        own = whole - inner;
    } else if (p.part == SUCKERS_CUP) {
        own = inner;
    }
    // Cosine of sixteen times the angle about the center.
    float cosine = dot(away, heading) / distance;
    float turns = cosine * cosine;
    turns = 8.0 * turns * (turns - 1.0) + 1.0;
    turns = 2.0 * turns * turns - 1.0;
    turns = 2.0 * turns * turns - 1.0;
    // The folds run from the hole across the cup and end on the rim.
    float fold = p.folds * (0.5 - 0.5 * clear * turns) * (1.0 - pit) * (0.3 + 0.7 * inner);
    return max(own, 0.0) * (1.0 - fold);
}

// Rings around the site.
float suckers_layer(suckers_values p, Site site) {
    float texel = site.footprint / p.cell;
    float reach = disk_reach(disk_of(0.86 * p.radius, 0.14 * p.radius, texel));
    float t = 0.0;
    Marks marks = find_marks(site.position / p.cell, site.normal, reach);
    for (ivec3 cell = marks.first; cell.z <= marks.last.z; cell = next_cell(marks, cell)) {
        vec4 hashed = hash_marks(marks, cell, p.period, p.seed);
        for (int which = 0; which < 2; ++which) {
            Mark mark = mark_of(marks, cell, hashed, which, p.jitter, site.normal);
            if (mark.near <= 0.0 || dot(mark.along, mark.along) > reach * reach) {
                continue;
            }
            float radius = p.radius * sqrt(mark.near) * (1.0 - p.variation * mark.random.w);
            Disk rim = disk_of(0.86 * radius, 0.14 * radius, texel);
            Disk cup = disk_of(0.6 * radius, 0.1 * radius, texel);
            Disk hole = disk_of(0.2 * radius, 0.07 * radius, texel);
            vec3 heading = along_surface(more_random(mark.random).xyz - 0.5, site.normal);
            float clear = 1.0 - smoothstep(0.05, 0.2, texel / max(radius, 1e-6));
            t += suckers_ring(p, rim, cup, hole, mark.along, heading, clear);
        }
    }
    return min(t, 1.0);
}
