// Mikkelsen 2010, "Bump Mapping Unparametrized Surfaces on the GPU": the surface gradient of a height in mm.
// Differs from the paper: dpdu and dpdv come from the mesh instead of screen derivatives, and are not unit vectors,
// because their length carries the metric: divided by it, slopes are mm per mm, and no product leaves float32 however
// thin a triangle is in uv. Without slope the normal returns bit by bit; where the mapping is degenerate (det = 0) it is
// kept.
const float STEEPEST = 1e6;  // beyond it a normal lies in the surface, within what float32 tells apart

vec3 bumped_normal(vec3 N, vec3 dpdu, vec3 dpdv, vec2 dh) {
    vec2 along = max(vec2(length(dpdu), length(dpdv)), 1e-9);
    vec2 rise = clamp(dh / along, -1e37, 1e37);
    rise *= STEEPEST / max(max(abs(rise.x), abs(rise.y)), STEEPEST);
    vec3 R1 = cross(dpdv / along.y, N);
    vec3 R2 = cross(N, dpdu / along.x);
    float det = dot(dpdu / along.x, R1);
    vec3 gradient = sign(det) * (rise.x * R1 + rise.y * R2);
    if (gradient == vec3(0.0)) {
        return N;
    }
    vec3 bumped = abs(det) * N - gradient;
    float length2 = dot(bumped, bumped);
    return length2 > 0.0 ? bumped / sqrt(length2) : N;
}

// Slope of the height along u and v in mm per unit of uv. A texel holds (dH/du, dH/dv) of the height map and, from
// normal maps, the dimensionless slopes along u and across it towards v, the frame that MikkTSpace defines.
vec2 height_slope(vec4 texel, vec3 dpdu, vec3 dpdv, float bumpiness) {
    float along = length(dpdu);
    float shear = dot(dpdv, dpdu) / max(along, 1e-9);
    float across = sqrt(max(dot(dpdv, dpdv) - shear * shear, 0.0));
    return bumpiness * (texel.xy + vec2(texel.z * along, texel.z * shear + texel.w * across));
}

// Interpolated normals shorten between vertices; a zero normal stays zero instead of becoming NaN.
vec3 unit_or_zero(vec3 v) {
    float length2 = dot(v, v);
    return length2 > 0.0 ? v / sqrt(length2) : vec3(0.0);
}
