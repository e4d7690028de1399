#include "lib/band.glsl"
#include "lib/filter.glsl"
#include "lib/noise.glsl"
#include "lib/site.glsl"

// Places along a side of a texel that is large for the noise, at most.
const int NOISE_PLACES = 8;

float noise_point(noise_values p, vec3 position, float footprint) {
    vec3 x = position / p.scale;
    vec3 whole = floor(x);
    ivec3 cell = ivec3(whole);
    vec3 fraction = x - whole;
    float noise = p.kind == NOISE_VALUE ? value_noise(cell, fraction, p.period, p.seed).x
        : p.kind == NOISE_GRADIENT ? gradient_noise(cell, fraction, p.period, p.seed)
        : simplex_noise(cell, fraction, p.period, p.seed);
    float texel = footprint / p.scale;
    float visible = exp(-min(p.fade * texel * texel, 80.0));
    float lost = 1.0 - visible * visible;
    // What the texel averages out blurs the step of the levels, see lib/fractal.glsl.
    float made = levels(0.5 + p.amplitude * visible * noise, p.levels, p.deviation * sqrt(5.0 * lost));
    return clamp(made + p.bias * lost, 0.0, 1.0);
}

// Noise of one size.
float noise_layer(noise_values p, Site site) {
    int count = places_of(site.footprint, p.finest, NOISE_PLACES);
    float sum = 0.0;
    for (int i = 0; i < count * count; ++i) {
        vec3 place = site.position + place_in_texel(site.normal, site.footprint, i, count);
        sum += noise_point(p, place, site.footprint / float(count));
    }
    return sum / float(count * count);
}
