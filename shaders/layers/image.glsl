#include "lib/band.glsl"
#include "lib/filter.glsl"
#include "lib/hash.glsl"
#include "lib/site.glsl"

// As the twin in skincli/layers/image.py has them.
const float IMAGE_SNAP = 1.0 / 256.0;
const float IMAGE_WIDEST = 8.0;
const float IMAGE_WIDEST_PLACE = 2.0;
const int IMAGE_PLACES = 4;

// What is laid by uv lies on a flat square.
Site image_ground(image_values p, Site site) {
    if (p.projection == IMAGE_UV) {
        site.position = vec3(site.uv, 0.0);
        site.normal = vec3(0.0, 0.0, 1.0);
        site.footprint = site.footprint_uv;
    }
    return site;
}

// How much the projections along x, y and z take part, so that no unwrap and no seam shows.
vec3 image_facing(vec3 normal) {
    vec3 weight = normal * normal;
    weight *= weight;
    return weight / max(weight.x + weight.y + weight.z, 1e-6);
}

// The whole part of the logarithm to base 2 of x, at least 1: exact, as log2 need not be.
int image_log2(float x) {
    return (floatBitsToInt(x) >> 23) - 127;
}

int image_last(sampler2D picture) {
    ivec2 size = textureSize(picture, 0);
    return image_log2(float(max(size.x, size.y)));
}

// Mean of the picture over a square `texel` wide about `tile`, in pictures; of bilinear samples where it is small.
vec4 image_mean(image_values p, sampler2D picture, vec2 tile, float texel, float widest) {
    ivec2 size = textureSize(picture, 0);
    float side = float(max(size.x, size.y));
    // A little early, so that rounding does not decide about widths that are powers of two.
    int level = min(image_log2(max(texel * side * (1.001 * 2.0 / widest), 1.0)), image_last(picture));
    size = max(size >> level, 1);  // textureSize would be asked for one level by all pixels of a group
    vec2 width = clamp(texel * vec2(size) - IMAGE_SNAP, vec2(1.0), vec2(size));
    vec2 inside = p.tile == IMAGE_CLAMP ? clamp(tile, -1.0, 2.0)
        : p.tile == IMAGE_MIRROR ? 1.0 - abs(mod(tile, 2.0) - 1.0) : fract(tile);
    vec2 start = inside * vec2(size) - 0.5 * width;
    vec2 corner = floor(start);
    vec2 low = clamp((start - corner - IMAGE_SNAP) / (1.0 - 2.0 * IMAGE_SNAP), 0.0, 1.0);
    vec2 high = low + width;
    ivec2 count = ivec2(ceil(high));
    vec4 sum = vec4(0.0);
    for (int y = 0; y < count.y; ++y) {
        vec4 row = vec4(0.0);
        for (int x = 0; x < count.x; ++x) {
            ivec2 at = ivec2(corner) + ivec2(x, y);
            if (p.tile == IMAGE_CLAMP) {
                at = clamp(at, ivec2(0), size - 1);
            } else {
                bvec2 before = lessThan(at, ivec2(0));
                bvec2 beyond = greaterThanEqual(at, size);
                ivec2 far = p.tile == IMAGE_MIRROR ? 2 * size - 1 - at : at - size;
                ivec2 near = p.tile == IMAGE_MIRROR ? -1 - at : at + size;
                at = ivec2(before.x ? near.x : beyond.x ? far.x : at.x, before.y ? near.y : beyond.y ? far.y : at.y);
            }
            row += (min(float(x + 1), high.x) - max(float(x), low.x)) * texelFetch(picture, at, level);
        }
        sum += (min(float(y + 1), high.y) - max(float(y), low.y)) * row;
    }
    return sum / (width.x * width.y);
}

// What the layer returns for a color of the picture: color and pattern, or the two slopes of a normal map.
vec4 image_value(image_values p, vec4 color) {
    if (p.role == IMAGE_NORMAL_GL || p.role == IMAGE_NORMAL_DX) {
        // A tangent-space normal is (-dh/du, -dh/dv, 1) scaled; DirectX counts v downwards. The bound on z keeps a
        // normal that lies in the surface from becoming an endless slope.
        vec3 normal = 2.0 * color.rgb - 1.0;
        vec2 slope = -normal.xy / max(normal.z, 0.05);
        return vec4(slope.x, p.role == IMAGE_NORMAL_DX ? -slope.y : slope.y, 0.0, 0.0);
    }
    color = mix(vec4(p.range.x), vec4(p.range.y), color);
    float grey = dot(color, p.grey);
    return p.role == IMAGE_GREY ? vec4(grey) : vec4(color.rgb, grey);
}

// One projection of the picture.
vec4 image_plane(image_values p, sampler2D picture, vec2 tile, float texel) {
    vec4 value = image_value(p, image_mean(p, picture, tile, texel, IMAGE_WIDEST));
    if (p.tile == IMAGE_MIRROR && (p.role == IMAGE_NORMAL_GL || p.role == IMAGE_NORMAL_DX)) {
        value.xy *= 1.0 - 2.0 * step(1.0, mod(tile, 2.0));
    }
    return value;
}

vec4 image_layer(image_values p, Site site, sampler2D picture) {
    Site ground = image_ground(p, site);
    vec3 tile = ground.position / p.period;
    vec2 planes[3] = vec2[3](tile.yz, tile.zx, tile.xy);
    vec3 facing = image_facing(ground.normal);
    vec4 sum = vec4(0.0);
    for (int plane = 0; plane < 3; ++plane) {
        if (facing[plane] > 0.0) {
            sum += facing[plane] * image_plane(p, picture, planes[plane], ground.footprint / p.period);
        }
    }
    return sum;
}

// Three patches about `tile`, each from a random place of the picture, by the corners of a triangle grid whose rows are
// as far apart as the corners in them. Added to `sum` with weights whose squares are added to `power`.
void image_patches(
    image_values p, sampler2D gaussian, vec2 tile, float texel, int plane, float share, inout vec4 sum,
    inout float power
) {
    vec2 x = tile / p.step;
    x.x -= 0.5 * x.y;
    vec2 cell = floor(x);
    vec2 fraction = x - cell;
    bool far = fraction.x + fraction.y > 1.0;
    ivec2 corner = ivec2(far ? 1 : 0);
    int other = far ? -1 : 1;
    vec2 near = far ? 1.0 - fraction : fraction;
    vec3 weights = vec3(1.0 - near.x - near.y, near);
    for (int i = 0; i < 3; ++i) {
        ivec2 at = corner + other * ivec2(i & 1, i >> 1);
        int row = int(cell.y) + at.y;
        int column = int(cell.x) + at.x + (row >> 1);
        vec2 start = hash_cell(wrap_cell(ivec3(column, row, plane), p.cells), p.seed).xy;
        vec2 away = fraction - vec2(at);
        away.x += 0.5 * away.y;
        // Squared, weights end smoothly, and one patch rules over most of its place.
        float weight = share * weights[i] * weights[i];
        sum += weight * image_mean(p, gaussian, start + p.step * away, texel, IMAGE_WIDEST_PLACE);
        power += weight * weight;
    }
}

// One row of the table, each channel at its own place.
vec4 image_row(image_values p, sampler2D table, vec4 x, int row) {
    vec2 size = vec2(textureSize(table, 0));
    float y = (float(row) + 0.5) / size.y;
    x = (x * (size.x - 1.0) + 0.5) / size.x;
    float first = textureLod(table, vec2(x.r, y), 0.0).r;
    if (p.role == IMAGE_GREY) {
        return vec4(first, 0.0, 0.0, 0.0);
    }
    return vec4(
        first, textureLod(table, vec2(x.g, y), 0.0).g, textureLod(table, vec2(x.b, y), 0.0).b,
        textureLod(table, vec2(x.a, y), 0.0).a
    );
}

// From Gaussian values of a level of detail back to coordinates along the axes of the picture's colors.
vec4 image_restore(image_values p, vec4 gaussian, float level, sampler2D table) {
    vec4 x = clamp(gaussian + 0.5, 0.0, 1.0);
    int lower = int(level);
    vec4 along = image_row(p, table, x, lower);
    return level > float(lower) ? mix(along, image_row(p, table, x, lower + 1), level - float(lower)) : along;
}

// The color at these coordinates; skincli/layers/histogram.py has the rows of the table.
vec4 image_color(image_values p, vec4 along, int last, sampler2D table) {
    if (p.role == IMAGE_GREY) {
        return along;
    }
    vec4 color = vec4(0.0);
    for (int axis = 0; axis < 4; ++axis) {
        color += along[axis] * texelFetch(table, ivec2(0, last + 1 + axis), 0);
    }
    vec4 lowest = texelFetch(table, ivec2(0, last + 5), 0);
    vec4 highest = texelFetch(table, ivec2(0, last + 6), 0);
    return clamp(color, lowest, highest);
}

// Synthesized from patches [Heitz2018]. A mixture of Gaussian values, divided by the root of the sum of the squares of
// the weights, is Gaussian of the same variance; so are the three projections together.
vec4 image_layer(image_values p, Site site, sampler2D gaussian, sampler2D table) {
    Site ground = image_ground(p, site);
    vec3 facing = image_facing(ground.normal);
    ivec2 size = textureSize(gaussian, 0);
    float side = float(max(size.x, size.y));
    int last = image_last(gaussian);
    // The mean of what is restored is not what is restored of the mean.
    int count = min(places_of(ground.footprint, p.period / side), IMAGE_PLACES);
    float texel = ground.footprint / (p.period * float(count));
    float level = clamp(log2(max(texel * side, 1.0)), 0.0, float(last));
    float left = resolved(p.step, texel);
    vec4 along = vec4(0.0);
    for (int i = 0; i < count * count; ++i) {
        vec3 tile = (ground.position + place_in_texel(ground.normal, ground.footprint, i, count)) / p.period;
        vec2 planes[3] = vec2[3](tile.yz, tile.zx, tile.xy);
        vec4 sum = vec4(0.0);
        float power = 0.0;
        for (int plane = 0; plane < 3; ++plane) {
            if (facing[plane] > 0.0) {
                image_patches(p, gaussian, planes[plane], texel, plane, facing[plane], sum, power);
            }
        }
        along += image_restore(p, left * inversesqrt(max(power, 1e-12)) * sum, level, table);
    }
    return image_value(p, image_color(p, along / float(count * count), last, table));
}
