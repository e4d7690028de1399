// Integer hashing of cells. Equal on every driver, which a hash made of sines is not.

// [Jarzynski2020, "Hash Functions for GPU Rendering", pcg4d]
uvec4 pcg4d(uvec4 v) {
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    v ^= v >> 16u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    return v;
}

// Four independent numbers in [0, 1) of a cell; multiples of 2^-24, so exact in float32.
vec4 hash_cell(ivec3 cell, int seed) {
    return vec4(pcg4d(uvec4(uvec3(cell), uint(seed))) >> 8u) * (1.0 / 16777216.0);
}

// The cell that stands for `cell` where patterns repeat every `period` cells along x and y. Only a tileable map has
// patterns that repeat; elsewhere this costs nothing. Up to 8 periods below 0 are allowed.
ivec3 wrap_cell(ivec3 cell, int period) {
#ifdef TILEABLE
    cell.xy = ivec2(uvec2(cell.xy + 8 * period) % uint(period));
#endif
    return cell;
}
