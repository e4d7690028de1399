#include "lib/band.glsl"
#include "lib/noise.glsl"
#include "lib/site.glsl"

// Noise of one size.
float noise_layer(noise_values p, Site site) {
    vec3 x = site.position / p.scale;
    vec3 whole = floor(x);
    ivec3 cell = ivec3(whole);
    vec3 fraction = x - whole;
    float noise = p.kind == NOISE_VALUE ? value_noise(cell, fraction, p.period, p.seed).x
        : p.kind == NOISE_GRADIENT ? gradient_noise(cell, fraction, p.period, p.seed)
        : simplex_noise(cell, fraction, p.period, p.seed);
    float texel = site.footprint / p.scale;
    float visible = exp(-min(p.fade * texel * texel, 80.0));
    float lost = 1.0 - visible * visible;
    // What the texel averages out blurs the step of the levels, see lib/fractal.glsl.
    return levels(0.5 + p.amplitude * visible * noise, p.levels, p.deviation * sqrt(5.0 * lost));
}
