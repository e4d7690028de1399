#include "lib/band.glsl"
#include "lib/hash.glsl"

// Marks scattered over a surface: the points of a jittered body-centered lattice, two per cell, that lie near the
// surface, projected onto it along the normal, so that a mark keeps its shape on any form and knows no seam.
// Lengths are in cells; per area of one cell squared there is one mark, so a cell is as large as the marks are apart.
// Twin: skincli/layers/marks.py, where a layer's loop is shown.

// A mark farther from the surface than MARK_SHELL does not show, one nearer than MARK_CORE shows in full. Their sum is
// 1/2, the thickness in which two marks per cell volume are one per cell area.
const float MARK_SHELL = 0.3;
const float MARK_CORE = 0.2;

// Where in its layer of cells a flat square, whose z is 0, lies: by one of the two lattices, and so that the marks of
// that layer alone show.
const float MARK_ASIDE = 0.3125;

// The cells whose marks may reach a place: the box from `first` to `last`, counted from the place's own cell.
struct Marks {
    ivec3 home;     // the place's own cell
    vec3 fraction;  // the place in it
    ivec3 first;
    ivec3 last;
};

struct Mark {
    vec3 along;   // from the place to the mark's center, along the surface
    float near;   // 1 where the mark shows in full, 0 where it is too far above or below the surface
    vec4 random;  // four numbers in [0, 1); xyz have placed the mark and only their finer digits are free
};

// All cells that can hold a mark whose center is at most `extent` from x along the three axes. Marks lie within their
// cells, so none is cut off, however large the extent.
Marks find_marks(vec3 x, vec3 extent) {
    x += MARK_ASIDE;
    vec3 home = floor(x);
    vec3 fraction = x - home;
    return Marks(ivec3(home), fraction, ivec3(floor(fraction - extent)), ivec3(floor(fraction + extent)));
}

// The same for marks that reach `radius` along the surface: centers lie in a disk of that radius, MARK_SHELL thick to
// both sides.
Marks find_marks(vec3 x, vec3 normal, float radius) {
    return find_marks(x, radius * sqrt(max(1.0 - normal * normal, 0.0)) + MARK_SHELL * abs(normal));
}

// The same for marks that reach `reach.x` along the unit vector `axis` of the surface and `reach.y` along `side`.
Marks find_marks(vec3 x, vec3 normal, vec3 axis, vec3 side, vec2 reach) {
    return find_marks(x, reach.x * abs(axis) + reach.y * abs(side) + MARK_SHELL * abs(normal));
}

// The cell after `cell`, row by row; behind the last, z exceeds that of `marks.last`.
ivec3 next_cell(Marks marks, ivec3 cell) {
    cell.x += 1;
    if (cell.x > marks.last.x) {
        cell.x = marks.first.x;
        cell.y += 1;
    }
    if (cell.y > marks.last.y) {
        cell.y = marks.first.y;
        cell.z += 1;
    }
    return cell;
}

// Four numbers in [0, 1) of a cell, from which both of its marks are made.
vec4 hash_marks(Marks marks, ivec3 cell, int period, int seed) {
    return hash_cell(wrap_cell(marks.home + cell, period), seed);
}

// Mark 0 or 1 of a cell. Without jitter these are the two points of a body-centered lattice; with jitter 1 each lies
// anywhere in a cube of 3/4 of the cell.
Mark mark_of(Marks marks, ivec3 cell, vec4 random, int which, float jitter, vec3 normal) {
    // Twelve of the 24 bits for the second mark: 1/4096 of a cell.
    vec4 own = which == 0 ? random : fract(4096.0 * random);
    float center = which == 0 ? 0.25 + 0.125 * jitter : 0.75 - 0.125 * jitter;
    vec3 to = vec3(cell) + center + 0.75 * jitter * (own.xyz - 0.5) - marks.fraction;
    float height = dot(to, normal);
    return Mark(to - height * normal, 1.0 - smoothstep(MARK_CORE, MARK_SHELL, abs(height)), own);
}

// The shape of a soft mark at a squared distance of 1 at its border: near to a Gaussian, which stays one when blurred.
float mark_bump(float squared) {
    float inside = max(1.0 - squared, 0.0);
    inside *= inside;
    return inside * inside;
}

// Farthest border of a mark that is out of round, in radii.
const float OUT_OF_ROUND = 1.21;

// The squared distance from the center of a mark of radius 1 that is not round: pulled towards `pull`, whose
// coordinates are -1 to 1, by `amount`, 0 to 1. The border stays within OUT_OF_ROUND.
float out_of_round(vec3 along, vec3 pull, float amount) {
    float squared = dot(along, along);
    return squared * (1.0 - 0.35 * amount * dot(along, pull) / (1.0 + squared));
}

// Squared radius, along one axis, of a bump seen through texels: a bump has the variance of a square as wide as its
// radius, and variances add up. A mark so widened is the weaker by the ratio of the radii, which keeps its mean.
float widened2(float radius, float texel) {
    return radius * radius + texel * texel;
}

// Four further numbers in [0, 1), of at least 8 bits, for all practical purposes independent of a mark's own.
vec4 more_random(vec4 random) {
    return fract(16.0 * random);
}

// A direction in the surface: the part of `direction` along it, of unit length; zero where there is none.
vec3 along_surface(vec3 direction, vec3 normal) {
    vec3 along = direction - dot(direction, normal) * normal;
    return along * inversesqrt(max(dot(along, along), 1e-12));
}
