#include "lib/fractal.glsl"

// Ridges where the noise changes its sign: octaves of (1 - |noise|)^2 [Musgrave1994].
float ridged_layer(ridged_values p, Site site) {
    Fractal numbers = Fractal(p.scale, p.period, p.octaves, p.gain, p.offset, p.amplitude, p.fade, p.octave, p.levels,
        p.seed);
    return fractal(FRACTAL_RIDGED, numbers, site);
}
