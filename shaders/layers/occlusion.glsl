#include "lib/band.glsl"
#include "lib/site.glsl"

// The openness of the mesh, baked.
float occlusion_layer(occlusion_values p, Site site) {
    return levels(site.occlusion, p.levels, 0.0);
}
