#include "lib/marks.glsl"
#include "lib/site.glsl"

// What one family of furrows leaves untouched: lenses along `axis`, each with a slant, a bend and a swing of its own.
// These shear a furrow sideways, which changes neither its width across nor its area.
float wrinkles_untouched(wrinkles_values p, Site site, vec3 axis, float texel, int seed) {
    vec3 side = cross(site.normal, axis);
    float wide2 = widened2(p.radius, texel);
    float long2 = widened2(p.reach, texel);
    float strength = p.radius * p.reach * inversesqrt(wide2 * long2);
    float long_reach = sqrt(long2);
    float untouched = 1.0;
    Marks marks = find_marks(
        site.position / p.cell, site.normal, axis, side, vec2(long_reach, sqrt(wide2) + p.wander * p.reach)
    );
    for (ivec3 cell = marks.first; cell.z <= marks.last.z; cell = next_cell(marks, cell)) {
        vec4 random = hash_marks(marks, cell, p.period, seed);
        for (int which = 0; which < 2; ++which) {
            Mark mark = mark_of(marks, cell, random, which, 1.0, site.normal);
            vec3 bends = 2.0 * more_random(mark.random).xyz - 1.0;
            float ahead = dot(mark.along, axis);
            float u = clamp(ahead / p.reach, -1.0, 1.0);
            float aside = u * (0.4 * bends.x + u * (0.3 * bends.y + u * 0.3 * bends.z));
            float across = dot(mark.along, side) + p.wander * p.reach * aside;
            float bump = mark_bump(ahead * ahead / long2 + across * across / wide2);
            untouched *= 1.0 - mark.near * strength * (1.0 - p.variation * mark.random.w) * bump;
        }
    }
    return untouched;
}

// 0 where the surface faces along the direction, so that this is none of it.
float wrinkles_local(wrinkles_values p, Site site) {
    float facing = dot(p.direction, site.normal);
    return smoothstep(0.01, 0.16, 1.0 - facing * facing);
}

// Furrows: 1 at the bottom of one, 0 between.
float wrinkles_layer(wrinkles_values p, Site site) {
    float texel = site.footprint / p.cell;
    vec3 axis = along_surface(p.direction, site.normal);
    float untouched = wrinkles_untouched(p, site, axis, texel, p.seed);
    if (p.cross > 0.0) {
        vec3 other = p.slant * axis + sqrt(1.0 - p.slant * p.slant) * cross(site.normal, axis);
        untouched *= mix(1.0, wrinkles_untouched(p, site, other, texel, ~p.seed), p.cross);
    }
    return wrinkles_local(p, site) * (1.0 - untouched);
}
