#include "lib/marks.glsl"
#include "lib/site.glsl"

// Round pits: 1 at the center of a pore, 0 between pores.
float pores_layer(pores_values p, Site site) {
    float texel = site.footprint / p.cell;
    float wide2 = widened2(p.radius, texel);
    float strength = p.radius * p.radius / wide2;
    float untouched = 1.0;
    Marks marks = find_marks(site.position / p.cell, site.normal, sqrt(wide2));
    for (ivec3 cell = marks.first; cell.z <= marks.last.z; cell = next_cell(marks, cell)) {
        vec4 random = hash_marks(marks, cell, p.period, p.seed);
        for (int which = 0; which < 2; ++which) {
            Mark mark = mark_of(marks, cell, random, which, p.jitter, site.normal);
            float bowl = mark_bump(dot(mark.along, mark.along) / wide2);
            untouched *= 1.0 - strength * mark.near * bowl * (1.0 - p.variation * mark.random.w);
        }
    }
    return 1.0 - untouched;
}
