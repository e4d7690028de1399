#include "lib/fractal.glsl"

// Octaves of |noise| [Perlin1985].
float turbulence_layer(turbulence_values p, Site site) {
    Fractal numbers = Fractal(p.scale, p.period, p.octaves, p.gain, p.offset, p.amplitude, p.fade, p.octave, p.levels,
        p.seed);
    return fractal(FRACTAL_TURBULENCE, numbers, site);
}
