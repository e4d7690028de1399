#include "lib/fractal.glsl"

// Puffs between creases: octaves of |noise|, the finer upon the coarser.
float billow_layer(billow_values p, Site site) {
    Fractal numbers = Fractal(p.scale, p.period, p.octaves, p.gain, p.offset, p.amplitude, p.fade, p.octave, p.levels,
        p.seed);
    return fractal(FRACTAL_BILLOW, numbers, site);
}
