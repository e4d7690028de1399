#include "lib/band.glsl"
#include "lib/noise.glsl"
#include "lib/site.glsl"

// What is made of the noise of each octave.
const int FRACTAL_FBM = 0;
const int FRACTAL_RIDGED = 1;
const int FRACTAL_BILLOW = 2;
const int FRACTAL_TURBULENCE = 3;

// Octaves of gradient noise, each half the size of the one before; a raw sum, which `offset` and `amplitude` bring into
// 0 to 1. Settings and twin: skincli/layers/fractal.py.
struct Fractal {
    float scale;
    int period;
    int octaves;
    float gain;
    float offset;
    float amplitude;
    float fade;
    vec2 octave;
    vec2 levels;
    int seed;
};

// An octave whose part of the texel's mean is less than this is not evaluated.
const float FRACTAL_LEAST = 0.01;

// Three deviations of gradient noise become 1.
const float FRACTAL_STRETCH = 1.745;

float fractal_octave(int kind, float noise) {
    float size = min(abs(noise), 1.0);
    return kind == FRACTAL_FBM ? noise : kind == FRACTAL_RIDGED ? (1.0 - size) * (1.0 - size) : size;
}

float fractal(int kind, Fractal p, Site site) {
    vec3 x = site.position / p.scale;
    vec3 whole = floor(x);
    ivec3 cell = ivec3(whole);
    vec3 fraction = x - whole;
    float texel = site.footprint / p.scale;
    // The fade is a Gaussian, so half the size has its fourth power.
    float visible = exp(-min(p.fade * texel * texel, 80.0));
    float amplitude = p.amplitude;
    float t = p.offset;
    float lost = 0.0;
    float weight = 1.0;
    int period = p.period;
    for (int octave = 0; octave < p.octaves; ++octave) {
        float value = p.octave.x;
        if (visible > FRACTAL_LEAST) {
            float noise = gradient_noise(cell, fraction, period, p.seed + 7919 * octave) * FRACTAL_STRETCH;
            value += visible * (fractal_octave(kind, noise) - value);
        }
        t += amplitude * weight * value;
        lost += amplitude * amplitude * (1.0 - visible * visible);
        // The finer puffs of a billow sit on the coarser, and leave the creases between these alone.
        weight = kind == FRACTAL_BILLOW ? min(2.0 * value, 1.0) : 1.0;
        amplitude *= p.gain;
        visible *= visible;
        visible *= visible;
        period *= 2;
        // Doubling cell and fraction apart loses no digit. The shift keeps the zeros of the octaves, which lie at the
        // corners of cells, from falling on each other.
        fraction = 2.0 * fraction + vec3(0.3125, 0.4375, 0.1875);
        whole = floor(fraction);
        cell = 2 * cell + ivec3(whole);
        fraction -= whole;
    }
    // What the texel averages out blurs the step of the levels; 5 is the square of half the width of a smooth step over
    // its variance.
    return levels(t, p.levels, p.octave.y * sqrt(5.0 * lost));
}
