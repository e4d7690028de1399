#include "lib/hash.glsl"

// Quintic fade: first and second derivatives vanish at 0 and 1 [Perlin2002, "Improving Noise"].
vec3 fade_quintic(vec3 x) {
    return x * x * x * (x * (x * 6.0 - 15.0) + 10.0);
}

// Gradient noise of a cell and the fraction in it, about -1 to 1, mean 0 [Perlin1985, "An Image Synthesizer"].
// Gradients are uniform in a cube: no table, no trigonometry, and equal variance along every direction.
float gradient_noise(ivec3 cell, vec3 fraction, int period, int seed) {
    vec3 far = fade_quintic(fraction);
    float sum = 0.0;
    for (int i = 0; i < 8; ++i) {
        ivec3 corner = ivec3(i & 1, (i >> 1) & 1, i >> 2);
        vec3 gradient = 2.0 * hash_cell(wrap_cell(cell + corner, period), seed).xyz - 1.0;
        vec3 weight = mix(1.0 - far, far, vec3(corner));
        sum += weight.x * weight.y * weight.z * dot(gradient, fraction - vec3(corner));
    }
    return sum;
}

// Three independent value noises, each -1 to 1.
vec3 value_noise(ivec3 cell, vec3 fraction, int period, int seed) {
    vec3 far = fade_quintic(fraction);
    vec3 sum = vec3(0.0);
    for (int i = 0; i < 8; ++i) {
        ivec3 corner = ivec3(i & 1, (i >> 1) & 1, i >> 2);
        vec3 weight = mix(1.0 - far, far, vec3(corner));
        sum += weight.x * weight.y * weight.z * (2.0 * hash_cell(wrap_cell(cell + corner, period), seed).xyz - 1.0);
    }
    return sum;
}

// The corner of tetrahedra that stands for `corner` where 3 * period steps along x and y repeat; up to 8 periods below 0.
ivec3 wrap_simplex(ivec3 corner, int period) {
#ifdef TILEABLE
    int whole = 18 * period;
    ivec2 along = 6 * corner.xy - (corner.x + corner.y + corner.z);
    ivec2 shift = ivec2(uvec2(along + 8 * whole) / uint(whole)) - 8;
    corner -= period * (shift.x + shift.y + ivec3(3 * shift, 0));
#endif
    return corner;
}

// Simplex noise, about -1 to 1, mean 0: bumps at the corners of tetrahedra [Perlin2001, "Noise Hardware"].
float simplex_noise(ivec3 cell, vec3 fraction, int period, int seed) {
    // The skewed place is cell + sum / 3. Thirds of whole numbers are kept apart, so that no digit is lost.
    int total = cell.x + cell.y + cell.z;
    uint shifted = uint(total + 805306368);
    vec3 skewed = fraction + (float(shifted % 3u) + fraction.x + fraction.y + fraction.z) / 3.0;
    vec3 carry = floor(skewed);
    skewed -= carry;
    ivec3 steps = int(shifted / 3u) - 268435456 + ivec3(carry);
    vec3 away = fraction + vec3(total + steps.x + steps.y + steps.z - 6 * steps) / 6.0;
    ivec3 order = ivec3(greaterThan(skewed, skewed.yzx)) + ivec3(greaterThanEqual(skewed, skewed.zxy));
    float sum = 0.0;
    for (int least = 3; least >= 0; --least) {
        ivec3 offset = ivec3(greaterThanEqual(order, ivec3(least)));
        vec3 to = away - vec3(offset) + float(offset.x + offset.y + offset.z) / 6.0;
        vec3 gradient = 2.0 * hash_cell(wrap_simplex(cell + steps + offset, period), seed).xyz - 1.0;
        float bump = max(0.5 - dot(to, to), 0.0);
        bump *= bump;
        sum += bump * bump * dot(gradient, to);
    }
    return 64.0 * sum;
}

// Move a position, mm, by up to `amount` mm along each axis, in swirls of `scale` mm, so that what is drawn there loses
// its regular shapes.
vec3 warp_position(vec3 position, float amount, float scale, int period, int seed) {
    vec3 x = position / scale;
    vec3 cell = floor(x);
    return position + amount * value_noise(ivec3(cell), x - cell, period, ~seed);
}
