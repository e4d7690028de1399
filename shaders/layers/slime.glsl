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
    float texel = site.footprint / p.scale;
    if (texel >= 6.0) {
        return p.mean;
    }
    int side = places_of(texel, 0.06, 8);
    float film = 0.0;
    for (int i = 0; i < side * side; ++i) {
        vec3 x = site.position / p.scale + place_in_texel(site.normal, texel, i, side);
        film += slime_film(p, x, texel / float(side));
    }
    float dry = 1.0 - film / float(side * side);
    if (p.drops > 0.0) {
        texel = site.footprint / p.cell;
        float drops = 0.0;
        side = places_of(texel, 0.3 * p.radius, 2);
        for (int i = 0; i < side * side && texel < 6.0; ++i) {
            vec3 x = site.position / p.cell + place_in_texel(site.normal, texel, i, side);
            drops += slime_drops(p, x, site.normal, texel / float(side));
        }
        dry *= 1.0 - mix(drops / float(side * side), p.drop_mean, smoothstep(0.75, 6.0, texel));
    }
    return mix(1.0 - dry, p.mean, smoothstep(0.5, 6.0, site.footprint / p.scale));
}
