#include "lib/filter.glsl"
#include "lib/noise.glsl"
#include "lib/site.glsl"

// Places along a side of a texel that is large for the blotches, at most.
const int MOTTLING_PLACES = 8;

// Noise of one size; `period` in cells.
float mottling_noise(vec3 position, float scale, int period, int seed) {
    vec3 x = position / scale;
    vec3 whole = floor(x);
    return gradient_noise(ivec3(whole), x - whole, period, seed);
}

// Blotches of two sizes, and the net of borders of the smaller, where their noise passes through 0.
float mottling_point(mottling_values p, vec3 position) {
    float large = mottling_noise(position, p.scale, p.period, p.seed);
    float small = mottling_noise(position, p.fine, p.fine_period, p.seed + 1);
    float raw = p.amplitude * (large + p.detail * small);
    float line = p.amplitude * small;
    float border = p.border.x - p.border.y * sqrt(line * line + p.border.z);
    return smoothstep(0.0, 1.0, 0.5 + mix(raw, border, p.net));
}

float mottling_layer(mottling_values p, Site site) {
    float visible = 1.0 - smoothstep(1.0, 8.0, site.footprint / p.scale);
    int count = visible > 0.0 ? places_of(site.footprint, p.finest, MOTTLING_PLACES) : 0;
    float sum = 0.0;
    for (int i = 0; i < count * count; ++i) {
        vec3 place = site.position + place_in_texel(site.normal, site.footprint, i, count);
        sum += mottling_point(p, place);
    }
    return mix(p.mean, sum / float(max(count * count, 1)), visible);
}
