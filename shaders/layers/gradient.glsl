#include "lib/filter.glsl"
#include "lib/site.glsl"

// Texels that are smaller, in halves of the way from 0 to 1, see a line and not its ends: differences lose digits.
const float GRADIENT_WIDE = 0.02;

// The integral of a line that runs from 0 at -1 to 1 at 1.
float gradient_integral(float x) {
    float inside = clamp(x, -1.0, 1.0) + 1.0;
    return 0.25 * inside * inside + max(x - 1.0, 0.0);
}

// 0 at a start, 1 at an end: along an axis, by the height of the layers below, or by the angle to an axis.
float gradient_layer(gradient_values p, Site site) {
    float across = length(cross(site.normal, p.axis));
    float texel = 0.0;
    float place = site.height;
    if (p.by == GRADIENT_AXIS) {
        place = dot(site.position, p.axis);
        texel = site.footprint * across;
    }
    if (p.by == GRADIENT_SLOPE) {
        // By the arc tangent, which is exact at every angle, as an arc cosine is not; it has no value at (0, 0).
        float along = dot(site.normal, p.axis);
        place = across + abs(along) > 0.0 ? degrees(atan(across, along)) : 0.0;
    }
    float away = 2.0 * p.sense * (place - p.middle);
    if (p.shape == GRADIENT_SMOOTH) {
        float t = clamp(0.5 + 0.5 * away / length(vec2(p.reach, EDGE_PER_TEXEL * texel)), 0.0, 1.0);
        return t * t * (3.0 - 2.0 * t);
    }
    float wide = texel / p.reach;
    float x = clamp(away / p.reach, -1.0 - 0.5 * wide, 1.0 + 0.5 * wide);
    float mean = gradient_integral(x + 0.5 * wide) - gradient_integral(x - 0.5 * wide);
    return wide < GRADIENT_WIDE ? clamp(0.5 + 0.5 * x, 0.0, 1.0) : mean / wide;
}
