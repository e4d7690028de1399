#include "lib/band.glsl"
#include "lib/hash.glsl"
#include "lib/site.glsl"

// Round pits: 1 at the centre of a pore, 0 between pores. Feature points of a jittered lattice within half a cell of
// the surface are projected onto it along the normal, so that pores stay round on any shape.
float pores_layer(pores_values p, Site site) {
    vec3 x = site.position / p.cell + 0.5;
    vec3 whole = floor(x);
    vec3 fraction = x - whole;
    // A pore smaller than a texel is drawn as wide as the texel and as much weaker, so that the mean is kept. 0.85
    // is the widest that lies wholly within the 27 cells sought.
    float radius = clamp(site.footprint / p.cell, p.radius, 0.85);
    float strength = p.radius * p.radius / (radius * radius);
    float untouched = 1.0;
    for (int i = 0; i < 27; ++i) {
        ivec3 offset = ivec3(i % 3, (i / 3) % 3, i / 9) - 1;
        vec4 random = hash_cell(ivec3(whole) + offset, p.seed);
        vec3 point = vec3(offset) + 0.5 + p.jitter * (random.xyz - 0.5) - fraction;
        float height = dot(point, site.normal);
        float across = max(dot(point, point) - height * height, 0.0);
        float bowl = max(1.0 - across / (radius * radius), 0.0);
        float near = 1.0 - smoothstep(0.25, 0.5, abs(height));
        untouched *= 1.0 - strength * near * bowl * bowl * (1.0 - p.variation * random.w);
    }
    return mix(p.mean, 1.0 - untouched, resolved(p.cell, site.footprint));
}
