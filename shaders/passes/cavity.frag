// How open each texel of a relief lies to the sky: 1 on a plane and on peaks, towards 0 in narrow pits.
// The horizon is sought along DIRECTIONS lines, at STEPS distances each, growing by squares up to the radius.
#include "lib/fetch.glsl"

float footprint_at(ivec2 texel) {
    return p.footprint > 0.0 ? p.footprint : texelFetch(site_normal, texel, 0).w;
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(height, 0);
    float own = texelFetch(height, texel, 0).r;
    float mm = footprint_at(texel);
    if (mm <= 0.0) {
        cavity = vec4(1.0);
        return;
    }
    float covered = 0.0;
    for (int i = 0; i < CAVITY_DIRECTIONS; ++i) {
        vec2 direction = p.directions[i].xy;
        float horizon = 0.0;
        for (int k = 1; k <= CAVITY_STEPS; ++k) {
            float share = float(k) / float(CAVITY_STEPS);
            // No farther than the map is wide; that also keeps the numbers within those of an int.
            vec2 offset = floor(direction * min(share * share * p.radius / mm, float(size.x)) + 0.5);
            ivec2 there = texel + ivec2(offset);
            ivec2 inside = (there + size) % size;
            // Beyond the map's edge nothing rises, unless it repeats; nor does what lies beside the mesh's charts.
            bool seen = (p.repeats == 1 || there == inside) && footprint_at(inside) > 0.0;
            float run = length(offset) * mm;
            float rise = texelFetch(height, inside, 0).r - own;
            if (seen && run > 0.0 && rise > 0.0) {
                horizon = max(horizon, rise * rise / (rise * rise + run * run));
            }
        }
        covered += horizon;
    }
    cavity = vec4(1.0 - covered / float(CAVITY_DIRECTIONS));
}
