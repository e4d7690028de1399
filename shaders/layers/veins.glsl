#include "lib/filter.glsl"
#include "lib/noise.glsl"
#include "lib/site.glsl"

// Size and width of each level, relative to the one before; the size so that twice as many cells fit a period.
const float VEINS_FINER = 0.5;
const float VEINS_THINNER = 0.62;

// Gradient noise in w and its slope, per cell, in xyz.
vec4 veins_noise(ivec3 cell, vec3 fraction, int period, int seed) {
    vec3 far = fade_quintic(fraction);
    vec3 steep = 30.0 * fraction * fraction * (fraction - 1.0) * (fraction - 1.0);
    vec4 sum = vec4(0.0);
    for (int i = 0; i < 8; ++i) {
        ivec3 corner = ivec3(i & 1, (i >> 1) & 1, i >> 2);
        vec3 gradient = 2.0 * hash_cell(wrap_cell(cell + corner, period), seed).xyz - 1.0;
        float value = dot(gradient, fraction - vec3(corner));
        vec3 weight = mix(1.0 - far, far, vec3(corner));
        vec3 slope = mix(-steep, steep, vec3(corner)) * weight.yzx * weight.zxy;
        float share = weight.x * weight.y * weight.z;
        sum += vec4(share * gradient + slope * value, share * value);
    }
    return sum;
}

// Veins: lines where noise passes through 0. Those of each finer noise begin at the ones before, on one side of them,
// and fade with the distance, so that they spring from them as branches do.
float veins_layer(veins_values p, Site site) {
    float size = p.spacing;
    float width = p.width;
    int period = p.period;
    float grown = 1.0;
    float untouched = 1.0;
    for (int level = 0; level < p.levels; ++level) {
        vec3 x = site.position / size;
        vec3 whole = floor(x);
        vec4 noise = veins_noise(ivec3(whole), x - whole, period, p.seed + 7919 * level);
        vec3 slope = noise.xyz - dot(noise.xyz, site.normal) * site.normal;
        float steepness = length(slope);
        // Distance to the line, in units of `size`. Where the noise is flat, lines would be blots: they end before.
        float away = noise.w / max(steepness, 0.05);
        float ends = smoothstep(0.25, 0.7, steepness);
        float texel = site.footprint / size;
        float half_width = width / size;
        float wide2 = half_width * half_width + 11.0 / 12.0 * texel * texel;
        float inside = max(1.0 - away * away / wide2, 0.0);
        inside *= inside;
        float line = half_width * inversesqrt(wide2) * inside * inside;
        untouched *= 1.0 - grown * ends * line;
        // The next level grows on the positive side of this one.
        grown *= ends * soft_step(away, 0.02, texel) * (1.0 - smoothstep(0.1, p.branching, away));
        size *= VEINS_FINER;
        width *= VEINS_THINNER;
        period *= 2;
    }
    return 1.0 - untouched;
}
