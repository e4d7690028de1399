#include "lib/filter.glsl"
#include "lib/marks.glsl"
#include "lib/noise.glsl"
#include "lib/site.glsl"

// Share of a texel, in sizes of the film's features like x, that pools cover: noise pulled about by noise, cut off.
float slime_film(slime_values p, vec3 x, float texel) {
    vec3 whole = floor(x);
    vec3 pull = value_noise(ivec3(whole), x - whole, p.period, ~p.seed);
    x += 0.5 * pull;
    whole = floor(x);
    float noise = gradient_noise(ivec3(whole), x - whole, p.period, p.seed);
    return soft_step(noise + 0.15 * pull.x - p.level, 0.16, texel);
}

// Drops around the place x, all in distances between drops.
float slime_drops(slime_values p, vec3 x, vec3 normal, float texel) {
    float widening = 2.0 / 3.0 * texel * texel;
    float reach = sqrt(p.radius * p.radius + widening);
    float untouched = 1.0;
    Marks marks = find_marks(x, normal, reach);
    for (ivec3 cell = marks.first; cell.z <= marks.last.z; cell = next_cell(marks, cell)) {
        vec4 random = hash_marks(marks, cell, p.drop_period, p.seed ^ 0x5BD1E995);
        for (int which = 0; which < 2; ++which) {
            Mark mark = mark_of(marks, cell, random, which, 0.9, normal);
            float there = clamp(4.0 * (1.25 * p.drops - more_random(mark.random).w), 0.0, 1.0);
            float own = p.radius * (0.6 + 0.4 * mark.random.w);
            float own2 = mark.near * there * own * own;
            float radius2 = max(own2 + widening, 1e-12);
            float bowl = max(1.0 - dot(mark.along, mark.along) / radius2, 0.0);
            untouched *= 1.0 - own2 / radius2 * bowl * bowl;
        }
    }
    return 1.0 - untouched;
}

// A wet film: 1 in pools and on drops, 0 where the skin is dry.
float slime_layer(slime_values p, Site site) {
    float dry = 1.0 - slime_film(p, site.position / p.scale, site.footprint / p.scale);
    if (p.drops > 0.0) {
        dry *= 1.0 - slime_drops(p, site.position / p.cell, site.normal, site.footprint / p.cell);
    }
    return 1.0 - dry;
}
