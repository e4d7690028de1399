#include "lib/site.glsl"

// A mirrored tile runs backwards in every second one; the sampler itself repeats or clamps.
vec2 image_fold(image_values p, vec2 tile) {
    return p.tile == IMAGE_MIRROR ? 1.0 - abs(mod(tile, 2.0) - 1.0) : tile;
}

// One sample at `tile`, in tiles; `texel` is the size of the map's texel, in tiles.
vec4 image_sample(image_values p, vec2 tile, float texel, sampler2D picture) {
    ivec2 size = textureSize(picture, 0);
    vec3 color = textureLod(picture, image_fold(p, tile), log2(max(texel * float(max(size.x, size.y)), 1.0))).rgb;
    if (p.role == IMAGE_COLOR) {
        return vec4(color, dot(color, p.grey));
    }
    if (p.role == IMAGE_GREY) {
        return vec4(color.r);
    }
    // A tangent-space normal is (-dh/du, -dh/dv, 1) scaled; DirectX counts v downwards. The bound on z keeps a normal
    // that lies in the surface from becoming an endless slope.
    vec3 normal = 2.0 * color - 1.0;
    vec2 slope = -normal.xy / max(normal.z, 0.05);
    slope.y = p.role == IMAGE_NORMAL_DX ? -slope.y : slope.y;
    if (p.tile == IMAGE_MIRROR) {
        slope *= 1.0 - 2.0 * step(1.0, mod(tile, 2.0));
    }
    return vec4(slope, 0.0, 0.0);
}

// A picture: color and grey value, or the two slopes of a normal map.
vec4 image_layer(image_values p, Site site, sampler2D picture) {
    if (p.projection == IMAGE_UV) {
        vec2 tile = site.uv / p.period;
        return image_sample(p, tile, max(length(dFdx(tile)), length(dFdy(tile))), picture);
    }
    // Projected along the three axes and mixed by the normal, so that no unwrap and no seam shows.
    vec3 tile = site.position / p.period;
    float texel = site.footprint / p.period;
    vec3 weight = site.normal * site.normal;
    weight *= weight;
    weight /= max(weight.x + weight.y + weight.z, 1e-6);
    return weight.x * image_sample(p, tile.yz, texel, picture) + weight.y * image_sample(p, tile.zx, texel, picture)
        + weight.z * image_sample(p, tile.xy, texel, picture);
}
