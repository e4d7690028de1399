#include "lib/marks.glsl"
#include "lib/site.glsl"

// One leaning cone, 1 at its point. `away` leads from the middle of its base to the place, in radii of the base.
float papillae_cone(vec3 away, vec3 heading, float lean, float ridges, float rounding) {
    away -= lean * heading;
    float squared = dot(away, away);
    float ahead = dot(away, heading);
    // The slice of the cone on which the place lies solves a quadratic: 0 at the point, 1 at the base.
    float down = (lean * ahead + sqrt(lean * lean * ahead * ahead + (1.0 - lean * lean) * squared)) / (1.0 - lean * lean);
    // Cosine of eight times the angle about the point.
    float cosine2 = ahead * ahead / max(squared, 1e-9);
    float ridge = 8.0 * cosine2 * (cosine2 - 1.0) + 1.0;
    ridge = 2.0 * ridge * ridge - 1.0;
    down += 4.0 * ridges * ridge * down * down * max(1.0 - down, 0.0);
    float up = max(1.0 - sqrt(down * down + rounding), 0.0);
    return up * up;
}

// Pointed bumps around the site.
float papillae_layer(papillae_values p, Site site) {
    float texel = site.footprint / p.cell;
    float texel2 = texel * texel;
    float reach = sqrt(p.radius * p.radius + 5.0 / 6.0 * texel2);
    float untouched = 1.0;
    Marks marks = find_marks(site.position / p.cell, site.normal, reach);
    for (ivec3 cell = marks.first; cell.z <= marks.last.z; cell = next_cell(marks, cell)) {
        vec4 hashed = hash_marks(marks, cell, p.period, p.seed);
        for (int which = 0; which < 2; ++which) {
            Mark mark = mark_of(marks, cell, hashed, which, p.jitter, site.normal);
            if (mark.near <= 0.0 || dot(mark.along, mark.along) > reach * reach) {
                continue;
            }
            vec4 random = more_random(mark.random);
            float size = 1.0 - p.variation * (1.0 - mark.random.w * mark.random.w);
            float own = p.radius * (0.4 + 0.6 * size);
            float own2 = max(sqrt(mark.near) * own * own, 1e-6);
            // A cone averaged over a texel is as much wider as lower, so that its mean is kept.
            float radius2 = own2 + 5.0 / 6.0 * texel2;
            float radius = sqrt(radius2);
            vec3 heading = along_surface(random.xyz - 0.5, site.normal);
            float ridges = p.ridges * (1.0 - smoothstep(0.1, 0.4, texel / radius));
            float up = papillae_cone(-mark.along / radius, heading, p.lean * random.w, ridges, 0.16 * texel2 / radius2);
            untouched *= 1.0 - sqrt(mark.near) * size * own2 / radius2 * up;
        }
    }
    return 1.0 - untouched;
}
