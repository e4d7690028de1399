#include "lib/marks.glsl"
#include "lib/site.glsl"

// Scars: long marks of random direction, each with a bend; the puckers across them; or the stitches that closed them.
float scars_layer(scars_values p, Site site) {
    float texel = site.footprint / p.cell;
    // Stitches end square, about as far aside as a scar is wide; a pucker is as wide as the scar.
    float half_width = p.part == SCARS_STITCHES ? p.stitch : p.radius;
    float wide2 = widened2(half_width, texel);
    float long2 = widened2(p.reach, texel);
    float strength = half_width * p.reach * inversesqrt(wide2 * long2);
    float line2 = widened2(p.thread, texel);
    // Beyond half their interval they would meet the next; there they are their mean.
    float lines_resolved = 1.0 - smoothstep(0.25, 0.5, texel / p.interval);
    float untouched = 1.0;
    float bow = p.bend * p.reach;
    Marks marks = find_marks(site.position / p.cell, site.normal, sqrt(long2 + wide2) + bow);
    for (ivec3 cell = marks.first; cell.z <= marks.last.z; cell = next_cell(marks, cell)) {
        vec4 random = hash_marks(marks, cell, p.period, p.seed);
        for (int which = 0; which < 2; ++which) {
            Mark mark = mark_of(marks, cell, random, which, 1.0, site.normal);
            vec4 more = more_random(mark.random);
            vec3 axis = along_surface(2.0 * more.xyz - 1.0, site.normal);
            float ahead = dot(mark.along, axis);
            float u = clamp(ahead / p.reach, -1.0, 1.0);
            float across = dot(mark.along, cross(site.normal, axis)) + bow * (2.0 * more.w - 1.0) * (u * u - 0.3);
            float t = strength * mark_bump(ahead * ahead / long2 + across * across / wide2);
            if (p.part != SCARS_LINE) {
                float place = ahead / p.interval + mark.random.w;
                float to_line = (place - floor(place) - 0.5) * p.interval;
                float line = p.thread * inversesqrt(line2) * mark_bump(to_line * to_line / line2);
                t *= mix(p.threads_mean, line, lines_resolved);
            }
            untouched *= 1.0 - mark.near * (1.0 - p.variation * mark.random.w) * t;
        }
    }
    return 1.0 - untouched;
}
