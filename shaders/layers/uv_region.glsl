#include "lib/filter.glsl"
#include "lib/site.glsl"

// 1 inside a region of the uv square, 0 outside.
float uv_region_layer(uv_region_values p, Site site) {
    vec2 away = site.uv - p.center;
    float texel = site.footprint_uv;
    if (p.shape == UV_REGION_RECTANGLE) {
        // The difference of two steps, so that what is narrower than a texel keeps its share of it.
        float across = soft_step(away.x + p.reach.x, p.feather, texel) - soft_step(away.x - p.reach.x, p.feather, texel);
        float along = soft_step(away.y + p.reach.y, p.feather, texel) - soft_step(away.y - p.reach.y, p.feather, texel);
        return across * along;
    }
    // Distance to the border, by the slope of the radius, which has none in the middle; as of a disk of equal area.
    vec2 scaled = away / p.reach;
    float radius = length(scaled);
    float inside = (1.0 - radius) * radius / max(length(scaled / p.reach), 1e-6);
    inside = radius < 1e-3 ? min(p.reach.x, p.reach.y) : inside;
    float mean = sqrt(p.reach.x * p.reach.y);
    return disk_at(disk_of(mean, min(p.feather, mean), texel), mean - inside);
}
