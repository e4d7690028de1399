#include "lib/hash.glsl"
#include "lib/site.glsl"

// The two integrals of the tile at x texels from texel `origin`, less `start`, those near it: differences of small
// numbers lose no digits. A quadratic B-spline keeps the pattern smooth where it is magnified, and its weights are
// exact where those of a texture filter have 8 bits.
vec2 reaction_diffusion_integrals(sampler2D tile, ivec2 origin, vec2 start, vec2 x) {
    vec2 whole = floor(x + 0.5);
    vec2 f = x - whole;
    ivec2 cell = origin + ivec2(whole);
    int last = textureSize(tile, 0).x - 1;  // of a power of two: the bits that stay when cells wrap around
    vec2 near = 0.5 * (0.5 - f) * (0.5 - f);
    vec2 far = 0.5 * (0.5 + f) * (0.5 + f);
    vec2 middle = 1.0 - near - far;
    vec3 along = vec3(near.x, middle.x, far.x);
    vec3 across = vec3(near.y, middle.y, far.y);
    vec2 total = vec2(0.0);
    for (int row = 0; row < 3; ++row) {
        int y = (cell.y + row - 1) & last;
        total += across[row]
            * (along.x * (texelFetch(tile, ivec2((cell.x - 1) & last, y), 0).xy - start)
                + along.y * (texelFetch(tile, ivec2(cell.x & last, y), 0).xy - start)
                + along.z * (texelFetch(tile, ivec2((cell.x + 1) & last, y), 0).xy - start));
    }
    return total;
}

// Mean of the tile over a square `width` texels wide about x, less the mean of the whole tile.
float reaction_diffusion_departure(sampler2D tile, ivec2 shift, vec2 x, float width) {
    // Corners are counted from the texel of x, so that far from the origin they keep their distances.
    vec2 whole = floor(x);
    ivec2 origin = ivec2(whole) + shift;
    vec2 start = texelFetch(tile, origin & (textureSize(tile, 0) - 1), 0).xy;
    vec2 low = x - whole - 0.5 * width;
    vec2 high = x - whole + 0.5 * width;
    vec2 low_low = reaction_diffusion_integrals(tile, origin, start, low);
    vec2 high_high = reaction_diffusion_integrals(tile, origin, start, high);
    float low_high = reaction_diffusion_integrals(tile, origin, start, vec2(low.x, high.y)).x;
    float high_low = reaction_diffusion_integrals(tile, origin, start, vec2(high.x, low.y)).x;
    return ((high_high.x - high_low - low_high + low_low.x) / width + high_high.y - low_low.y) / width;
}

// Spots, stripes, labyrinths and nets on a tile of integrals, from which the mean over a texel of any size follows.
float reaction_diffusion_layer(reaction_diffusion_values p, Site site, sampler2D tile) {
    float side = float(textureSize(tile, 0).x);
    vec3 x = site.position * (side / p.side);
    vec3 normal = site.normal;
    if (p.axis == REACTION_DIFFUSION_X) {
        x = x.zxy;
        normal = normal.zxy;
    } else if (p.axis == REACTION_DIFFUSION_Z) {
        x = x.yzx;
        normal = normal.yzx;
    }
    vec2 places[3] = vec2[3](x.zy, x.xz, x.xy);
    float width = length(vec2(site.footprint * (side / p.side), 2.0));
    vec3 facing = max(normal * normal - 0.27, 0.0);
    facing *= facing;
    float total = 0.0;
    // As many rounds as planes take part, mostly one: software GL would run all three branches of an `if`.
    int planes = int(facing.x > 0.0) + 2 * int(facing.y > 0.0) + 4 * int(facing.z > 0.0);
    for (int left = planes; left != 0; left &= left - 1) {
        int plane = (left & 1) != 0 ? 0 : (left & 2) != 0 ? 1 : 2;
        ivec2 shift = ivec2(side * hash_cell(ivec3(plane, 0, 0), p.seed).xy);
        total += facing[plane] * reaction_diffusion_departure(tile, shift, places[plane], width);
    }
    // Divided by the root of the sum of squares, a mixture of independent patterns has the contrast of each
    // [Heitz2018, variance-preserving blending].
    return clamp(texelFetch(tile, ivec2(0), 0).z + total / max(length(facing), 1e-6), 0.0, 1.0);
}
