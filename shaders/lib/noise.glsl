#include "lib/hash.glsl"

// Quintic fade: first and second derivatives vanish at 0 and 1 [Perlin2002, "Improving Noise"].
vec3 fade_quintic(vec3 x) {
    return x * x * x * (x * (x * 6.0 - 15.0) + 10.0);
}

// Gradient noise of a cell and the fraction in it, about -1 to 1, mean 0 [Perlin1985, "An Image Synthesizer"].
// Gradients are uniform in a cube: no table, no trigonometry, and equal variance along every direction.
float gradient_noise(ivec3 cell, vec3 fraction, int seed) {
    vec3 far = fade_quintic(fraction);
    float sum = 0.0;
    for (int i = 0; i < 8; ++i) {
        ivec3 corner = ivec3(i & 1, (i >> 1) & 1, i >> 2);
        vec3 gradient = 2.0 * hash_cell(cell + corner, seed).xyz - 1.0;
        vec3 weight = mix(1.0 - far, far, vec3(corner));
        sum += weight.x * weight.y * weight.z * dot(gradient, fraction - vec3(corner));
    }
    return sum;
}

// Three independent value noises, each -1 to 1.
vec3 value_noise(ivec3 cell, vec3 fraction, int seed) {
    vec3 far = fade_quintic(fraction);
    vec3 sum = vec3(0.0);
    for (int i = 0; i < 8; ++i) {
        ivec3 corner = ivec3(i & 1, (i >> 1) & 1, i >> 2);
        vec3 weight = mix(1.0 - far, far, vec3(corner));
        sum += weight.x * weight.y * weight.z * (2.0 * hash_cell(cell + corner, seed).xyz - 1.0);
    }
    return sum;
}

// Move x, in cells, by up to `amount` cells, so that what is drawn there loses its regular shapes.
vec3 warp_cells(vec3 x, float amount, int seed) {
    vec3 cell = floor(x);
    return x + amount * value_noise(ivec3(cell), x - cell, ~seed);
}
