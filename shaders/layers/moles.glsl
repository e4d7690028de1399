#include "lib/filter.glsl"
#include "lib/marks.glsl"
#include "lib/site.glsl"

// Moles: flat spots of even darkness with a soft edge, or the domes of those that are raised.
float moles_layer(moles_values p, Site site) {
    float texel = site.footprint / p.cell;
    float reach = sqrt(widened2(p.radius, texel));
    if (p.part == MOLES_SPOT) {
        reach = disk_reach(disk_of(p.edge * p.radius, p.softness * p.radius, texel));
    }
    float untouched = 1.0;
    Marks marks = find_marks(site.position / p.cell, site.normal, OUT_OF_ROUND * reach);
    for (ivec3 cell = marks.first; cell.z <= marks.last.z; cell = next_cell(marks, cell)) {
        vec4 random = hash_marks(marks, cell, p.period, p.seed);
        for (int which = 0; which < 2; ++which) {
            Mark mark = mark_of(marks, cell, random, which, p.jitter, site.normal);
            vec4 more = more_random(mark.random);
            float radius = p.radius * (1.0 - p.variation * more.w);
            vec3 pull = 2.0 * more.xyz - 1.0;
            float t;
            if (p.part == MOLES_SPOT) {
                Disk disk = disk_of(p.edge * radius, p.softness * radius, texel);
                float border = max(disk_reach(disk), 1e-9);
                float squared = out_of_round(mark.along / border, pull, p.irregularity);
                t = (1.0 - 0.5 * p.variation * mark.random.w) * disk_at(disk, border * sqrt(max(squared, 0.0)));
            } else {
                float wide2 = max(widened2(radius, texel), 1e-12);
                float bump = mark_bump(out_of_round(mark.along * inversesqrt(wide2), pull, p.irregularity));
                t = radius * radius / wide2 * clamp(4.0 * (p.raised - mark.random.w), 0.0, 1.0) * bump;
            }
            untouched *= 1.0 - mark.near * t;
        }
    }
    return 1.0 - untouched;
}
