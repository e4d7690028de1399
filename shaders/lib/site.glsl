// The point of the surface that a texel of a map stands for.
struct Site {
    vec3 position;    // mm: the point on the mesh, or (u, v, 0) times the extent of a flat square
    vec3 normal;      // unit
    vec2 uv;          // authored, 0 to 1 over the map
    float footprint;  // mm per texel
    float footprint_uv;  // size of a texel in uv
    float height;     // mm, the sum of the heights of the layers below
    float occlusion;  // baked ambient occlusion of the mesh, 1 is open
    float curvature;  // baked mean curvature of the mesh, 1/mm, positive where convex
};
