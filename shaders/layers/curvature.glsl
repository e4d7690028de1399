#include "lib/band.glsl"
#include "lib/site.glsl"

// The curvature of the mesh, baked.
float curvature_layer(curvature_values p, Site site) {
    return levels(site.curvature, p.levels, 0.0);
}
