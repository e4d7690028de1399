#include "lib/noise.glsl"
#include "lib/site.glsl"

// Noise of one size; `period` in cells.
float mottling_noise(vec3 position, float scale, int period, int seed) {
    vec3 x = position / scale;
    vec3 whole = floor(x);
    return gradient_noise(ivec3(whole), x - whole, period, seed);
}

// Blotches of two sizes, and the net of borders of the smaller, where their noise passes through 0.
float mottling_layer(mottling_values p, Site site) {
    float large = mottling_noise(site.position, p.scale, p.period, p.seed);
    float small = mottling_noise(site.position, p.fine, p.fine_period, p.seed + 1);
    float raw = p.amplitude * (large + p.detail * small);
    float line = p.amplitude * small;
    float border = p.border.x - p.border.y * sqrt(line * line + p.border.z);
    return smoothstep(0.0, 1.0, 0.5 + mix(raw, border, p.net));
}
