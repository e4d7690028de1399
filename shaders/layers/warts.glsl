#include "lib/marks.glsl"
#include "lib/noise.glsl"
#include "lib/site.glsl"

const float WARTS_GROWTH = 0.5;

// The mean of the cubed sizes: the share of the full height that is left where the density is lower.
float warts_grown(float density) {
    float low = min(density, WARTS_GROWTH);
    float high = max(density - 1.0, 0.0);
    float growing = (low * low * low * low - high * high * high * high) / (4.0 * WARTS_GROWTH * WARTS_GROWTH * WARTS_GROWTH);
    return max(density - WARTS_GROWTH, 0.0) + growing;
}

// How dense warts are: 0 to 1, and beyond by what the last need to grow. Low noise decides.
float warts_density(warts_values p, Site site) {
    float density = 1.0;
    if (p.clustering > 0.0) {
        vec3 x = site.position / p.cluster;
        vec3 whole = floor(x);
        float noise = gradient_noise(ivec3(whole), x - whole, p.cluster_period, ~p.seed);
        float clear = smoothstep(0.5, 4.0, p.cluster / max(site.footprint, 1e-9));
        density = 1.0 - p.clustering * (0.5 - clear * (smoothstep(-0.45, 0.45, noise) - 0.5));
    }
    return density * (1.0 + WARTS_GROWTH);
}

float warts_local(warts_values p, Site site) {
    return warts_grown(warts_density(p, site));
}

// Round bumps: 1 at the top of the largest, 0 between them.
float warts_layer(warts_values p, Site site) {
    float texel = site.footprint / p.cell;
    float density = warts_density(p, site);
    float widening = p.spread * texel * texel;
    float reach = sqrt(p.radius * p.radius + widening);
    float untouched = 1.0;
    Marks marks = find_marks(site.position / p.cell, site.normal, reach);
    for (ivec3 cell = marks.first; cell.z <= marks.last.z; cell = next_cell(marks, cell)) {
        vec4 hashed = hash_marks(marks, cell, p.period, p.seed);
        for (int which = 0; which < 2; ++which) {
            Mark mark = mark_of(marks, cell, hashed, which, p.jitter, site.normal);
            if (mark.near <= 0.0 || dot(mark.along, mark.along) > reach * reach) {
                continue;
            }
            float size = 1.0 - p.variation * mark.random.w;
            size *= clamp((density - more_random(mark.random).w) / WARTS_GROWTH, 0.0, 1.0);
            float own2 = sqrt(mark.near) * p.radius * p.radius * size * size;
            // A wart averaged over a texel is as much wider as lower, so that its mean is kept.
            float radius2 = max(own2 + widening, 1e-12);
            float bowl = max(1.0 - dot(mark.along, mark.along) / radius2, 0.0);
            untouched *= 1.0 - sqrt(mark.near) * size * own2 / radius2 * bowl * bowl * (1.0 + 2.0 * p.flatness * (1.0 - bowl));
        }
    }
    return 1.0 - untouched;
}
