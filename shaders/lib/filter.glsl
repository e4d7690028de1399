// Shapes as a texel sees them: averaged over its area. Twin: skincli/layers/filtering.py, which says why.

// Half the width of the step that a hard edge becomes: a smoothstep of half-width e has the variance e*e/5, a texel
// 1/12.
const float EDGE_PER_TEXEL = 0.6455;

// From 0 to 1 where d rises through 0; d, softness and texel in one unit.
float soft_step(float d, float softness, float texel) {
    float half_width = sqrt(softness * softness + EDGE_PER_TEXEL * EDGE_PER_TEXEL * texel * texel);
    return smoothstep(-half_width, half_width, d);
}

// What a texel makes of a disk: mean radius of its edge, half the width of the edge, and the value inside.
struct Disk {
    float radius;
    float edge;
    float strength;
};

// A disk of a radius whose edge is 2 * softness wide (softness at most the radius), over a texel; all in one unit.
Disk disk_of(float radius, float softness, float texel) {
    float mass = radius * radius + 0.2 * softness * softness;
    float room = 2.0 * (radius * radius - softness * softness);
    float texel2 = texel * texel;
    if (texel2 < room) {
        float edge = sqrt(softness * softness + 5.0 / 12.0 * texel2);
        return Disk(sqrt(radius * radius - texel2 / 12.0), max(edge, 1e-6), 1.0);
    }
    float spread = max(mass * 5.0 / 6.0 + 0.175 * (texel2 - room), 1e-12);
    return Disk(sqrt(spread), sqrt(spread), mass / (1.2 * spread));
}

// How far a disk reaches.
float disk_reach(Disk disk) {
    return disk.radius + disk.edge;
}

// Share of the texel that it covers where its center is `away` from the texel's.
float disk_at(Disk disk, float away) {
    return disk.strength * (1.0 - smoothstep(disk.radius - disk.edge, disk.radius + disk.edge, away));
}

// Places along a side of a texel at most: where features are larger than it, and where they are not.
const int PLACES = 8;
const int MOST_PLACES = 13;

// How many places along each side of a texel must be looked at so that they are at most `finest` apart: a power of 2.
int places_of(float footprint, float finest) {
    int count = 1;
    while (count < PLACES && footprint > finest * float(count)) {
        count *= 2;
    }
    return count;
}

// From the center of a texel to the i-th of its count * count places, mm.
vec3 place_in_texel(vec3 normal, float footprint, int i, int count) {
    // Two unit vectors along the surface [Duff2017, "Building an Orthonormal Basis, Revisited"].
    float side = normal.z < 0.0 ? -1.0 : 1.0;
    float a = -1.0 / (side + normal.z);
    float b = normal.x * normal.y * a;
    vec3 along_x = vec3(1.0 + side * normal.x * normal.x * a, side * b, -side * normal.x);
    vec3 along_y = vec3(b, side + normal.y * normal.y * a, -normal.y);
    // In floats, which hold these exactly: an integer division per texel is slow.
    float row = floor((float(i) + 0.5) / float(count));
    vec2 offset = (vec2(float(i) - row * float(count), row) + 0.5) / float(count) - 0.5;
    return footprint * (offset.x * along_x + offset.y * along_y);
}

// How a pattern is averaged over large texels: `band` is how far apart places may be, how large they may be, the size of
// a texel that is looked at in the most places, and that of one that shows the mean alone, all mm; `mean` is that on
// surfaces of all directions, and on the plane z = 0, where flat squares lie.

// How much of the pattern a texel shows, the rest being its mean.
float band_shown(vec4 band, float footprint) {
    float x = footprint / band.w;
    return max(1.0 - sqrt(x * sqrt(x * sqrt(x))), 0.0);
}

int band_places(vec4 band, float footprint) {
    int count = places_of(footprint, band.x);
    return count == PLACES && footprint > band.z ? MOST_PLACES : count;
}

float band_mean(vec2 mean, vec3 normal) {
    return mix(mean.x, mean.y, smoothstep(0.98, 1.0, normal.z * normal.z));
}
