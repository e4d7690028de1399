#include "lib/fractal.glsl"

// Fractional Brownian motion: octaves of gradient noise [Perlin1985].
float fbm_layer(fbm_values p, Site site) {
    Fractal numbers = Fractal(p.scale, p.period, p.octaves, p.gain, p.offset, p.amplitude, p.fade, p.octave, p.levels,
        p.seed);
    return fractal(FRACTAL_FBM, numbers, site);
}
