#include "lib/filter.glsl"
#include "lib/site.glsl"

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
    float widening = p.shape == GRADIENT_LINEAR ? 0.5 : EDGE_PER_TEXEL;
    float reach = length(vec2(p.reach, widening * texel));
    float t = clamp(0.5 + p.sense * (place - p.middle) / reach, 0.0, 1.0);
    return p.shape == GRADIENT_LINEAR ? t : t * t * (3.0 - 2.0 * t);
}
