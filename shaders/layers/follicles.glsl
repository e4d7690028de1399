#include "lib/marks.glsl"
#include "lib/site.glsl"

// How far out a rim ends, and a hair's root, in radii of the pit; how far along the hair the root lies; what makes the
// highest of a rim, which is the difference of two bumps, 1.
const float FOLLICLES_RIM_REACH = 2.0;
const float FOLLICLES_DOT_RADIUS = 0.45;
const float FOLLICLES_DOT_SHIFT = 0.3;
const float FOLLICLES_RIM_PEAK = 1.890078;

// A bump of `radius` around the site, longer along the hair, seen through texels.
float follicles_bump(follicles_values p, vec3 along, vec3 hair, float radius, float texel) {
    float wide2 = widened2(radius, texel);
    float long2 = widened2(radius * p.elongation, texel);
    float ahead = dot(along, hair);
    float squared = ahead * ahead * (1.0 / long2 - 1.0 / wide2) + dot(along, along) / wide2;
    return radius * radius * p.elongation * inversesqrt(wide2 * long2) * mark_bump(squared);
}

// Pits from which hairs grow, their raised rims, or the dark roots in them.
float follicles_layer(follicles_values p, Site site) {
    float texel = site.footprint / p.cell;
    vec3 hair = along_surface(p.direction, site.normal);
    float shift = p.part == FOLLICLES_DOT ? FOLLICLES_DOT_SHIFT * p.radius : 0.0;
    float largest = p.radius * (p.part == FOLLICLES_RIM ? FOLLICLES_RIM_REACH : 1.0);
    float reach = sqrt(widened2(largest * p.elongation, texel)) + shift;
    float untouched = 1.0;
    Marks marks = find_marks(site.position / p.cell, site.normal, reach);
    for (ivec3 cell = marks.first; cell.z <= marks.last.z; cell = next_cell(marks, cell)) {
        vec4 random = hash_marks(marks, cell, p.period, p.seed);
        for (int which = 0; which < 2; ++which) {
            Mark mark = mark_of(marks, cell, random, which, p.jitter, site.normal);
            float radius = p.radius * (1.0 - 0.5 * p.variation * more_random(mark.random).w);
            vec3 along = mark.along + shift * hair;
            float t;
            if (p.part == FOLLICLES_RIM) {
                t = FOLLICLES_RIM_PEAK * (follicles_bump(p, along, hair, FOLLICLES_RIM_REACH * radius, texel)
                    - follicles_bump(p, along, hair, radius, texel));
            } else {
                radius *= p.part == FOLLICLES_PIT ? 1.0 : FOLLICLES_DOT_RADIUS;
                t = follicles_bump(p, along, hair, radius, texel);
            }
            untouched *= 1.0 - mark.near * (1.0 - p.variation * mark.random.w) * t;
        }
    }
    return 1.0 - untouched;
}
