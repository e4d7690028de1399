// Mikkelsen 2010, "Bump Mapping Unparametrized Surfaces on the GPU": the surface gradient of a height in mm.
// Differs from the paper: dpdu and dpdv come from the mesh instead of screen derivatives, and are not unit vectors,
// because their length carries the metric. Without slope the normal returns bit by bit; where the mapping is
// degenerate (det = 0) it is kept.
vec3 bumped_normal(vec3 N, vec3 dpdu, vec3 dpdv, vec2 dh) {
    vec3 R1 = cross(dpdv, N);
    vec3 R2 = cross(N, dpdu);
    float det = dot(dpdu, R1);
    vec3 gradient = sign(det) * (dh.x * R1 + dh.y * R2);
    if (gradient == vec3(0.0)) {
        return N;
    }
    vec3 bumped = abs(det) * N - gradient;
    float length2 = dot(bumped, bumped);
    return length2 > 0.0 ? bumped / sqrt(length2) : N;
}

// Slope of the height along u and v in mm per unit of uv. A texel holds (dH/du, dH/dv) of the height map and, from
// normal maps, the dimensionless slopes along the two directions of the map.
vec2 height_slope(vec4 texel, vec3 dpdu, vec3 dpdv, float bumpiness) {
    return bumpiness * (texel.xy + texel.zw * vec2(length(dpdu), length(dpdv)));
}

// Interpolated normals shorten between vertices; a zero normal stays zero instead of becoming NaN.
vec3 unit_or_zero(vec3 v) {
    float length2 = dot(v, v);
    return length2 > 0.0 ? v / sqrt(length2) : vec3(0.0);
}
