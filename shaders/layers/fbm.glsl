#include "lib/band.glsl"
#include "lib/noise.glsl"
#include "lib/site.glsl"

// Fractional Brownian motion: octaves of gradient noise, each half the size of the one before.
float fbm_layer(fbm_values p, Site site) {
    vec3 x = warp_cells(site.position / p.scale, p.warp, p.seed);
    vec3 whole = floor(x);
    ivec3 cell = ivec3(whole);
    vec3 fraction = x - whole;
    float amplitude = p.amplitude;
    float size = p.scale;
    float sum = 0.5;
    // Octaves of one texel and less add nothing, see `resolved`.
    for (int octave = 0; octave < p.octaves && size > site.footprint; ++octave) {
        sum += amplitude * resolved(size, site.footprint) * gradient_noise(cell, fraction, p.seed + 7919 * octave);
        amplitude *= p.gain;
        size *= 0.5;
        // Doubling cell and fraction apart loses no digit. The shift keeps the zeros of the octaves, which lie at the
        // corners of cells, from falling on each other.
        fraction = 2.0 * fraction + vec3(0.3125, 0.4375, 0.1875);
        whole = floor(fraction);
        cell = 2 * cell + ivec3(whole);
        fraction -= whole;
    }
    return mix(p.mean, levels(sum, p.levels, site.footprint / p.scale), resolved(p.scale, site.footprint));
}
