#include "lib/filter.glsl"
#include "lib/hash.glsl"
#include "lib/site.glsl"

// All lengths are in distances between the scales of a row. Numbers: skincli/layers/scales.py.

// About how far inside a scale's outline a place is, `a` along and `b` across, both as shares of its size. The outline
// is between an ellipse and a rhombus; dividing by the slope makes of its function a distance.
float scales_inside(scales_values p, vec2 ab, float size) {
    float round_ = sqrt(max(dot(ab, ab), 1e-6));
    vec2 slope = mix(ab / round_, vec2(1.0), p.point) / vec2(p.reach, 0.55);
    float outline = mix(round_, ab.x + ab.y, p.point);
    return (size - outline) / sqrt(max(dot(slope, slope), 1e-2));
}

// Height and pattern of one plane's scales, each drawn over those of the rows towards which it points.
vec2 scales_rows(scales_values p, vec2 place, vec2 along, float texel, int layer) {
    float rows = dot(place, along) / p.row;
    float row = floor(rows);
    float down = rows - row;
    float sideways = place.y * along.x - place.x * along.y;
    float height = 0.0;
    float own = p.part == SCALES_VALUE ? 0.5 : 0.0;
    float keel = 0.35 * 0.55;
    float wide = sqrt(keel * keel + 7.0 / 12.0 * texel * texel);
    float soft = 0.015 + 0.6455 * texel;
    for (int ahead = 1; ahead >= -2; --ahead) {
        int line = int(row) + ahead;
        float across = sideways - 0.5 * float(line & 1);
        float column = floor(across);
        for (int beside = 0; beside < 2; ++beside) {
            ivec3 cell = ivec3(
                wrap_cell(ivec3(int(column) + beside, 0, 0), p.columns).x, wrap_cell(ivec3(line, 0, 0), p.rows).x, layer
            );
            vec4 random = hash_cell(cell, p.seed);
            float size = 1.0 - 0.3 * p.jitter * random.z;
            float a = (down - float(ahead) - 0.5 * p.jitter * (random.x - 0.5)) * p.row;
            float b = across - column - float(beside) - 0.3 * p.jitter * (random.y - 0.5);
            float inside = scales_inside(p, abs(vec2(a / p.reach, b / 0.55)), size);
            if (inside + p.gap < -soft) {
                continue;
            }
            float alpha = soft_step(inside, 0.015, texel);
            float rim = soft_step(inside + p.gap, 0.015, texel);
            float ramp = clamp(1.0 - (p.reach - a) / (2.0 * p.row), 0.0, 1.0);
            float dome = 1.0 - 0.5 * min(b * b / (0.55 * 0.55), 1.0);
            float ridge = max(1.0 - b * b / (wide * wide), 0.0);
            float body = (1.0 - p.keel) * (0.25 + 0.75 * ramp) * dome
                + p.keel * (0.3 + 0.7 * ramp) * keel / wide * ridge * ridge;
            float edge = mix(alpha, soft_step(inside - 0.06, 0.06, texel), 0.6);
            height = (1.0 - rim) * height + body * edge;
            if (p.part == SCALES_GAP) {
                own = (1.0 - rim) * own + rim - alpha;
            } else if (p.part == SCALES_VALUE) {
                own = mix(own, random.w, alpha);
            }
        }
    }
    return vec2(height, p.part == SCALES_SCALE ? height : own);
}

// The lattices of three planes; where two meet, the higher scale hides the other, and a dark crease parts them.
float scales_layer(scales_values p, Site site) {
    vec3 x = site.position / p.spacing;
    float texel = site.footprint / p.spacing;
    vec3 share = site.normal * site.normal;
    share = smoothstep(0.75, 1.0, share / max(max(share.x, share.y), max(share.z, 1e-12)));
    float best = -9.0;
    float t = 0.0;
    for (int axis = 0; axis < 3; ++axis) {
        if (share[axis] <= 0.0) {
            continue;
        }
        vec2 place = vec2(x[(axis + 1) % 3], x[(axis + 2) % 3]);
        vec2 along = axis == 0 ? p.along_x : axis == 1 ? p.along_y : p.along_z;
        vec2 found = scales_rows(p, place, along, texel, site.normal[axis] < 0.0 ? axis + 3 : axis);
        float lifted = found.x - 2.0 * (1.0 - share[axis]);
        t = mix(t, found.y, smoothstep(-0.05, 0.05, lifted - best));
        if (p.part != SCALES_VALUE) {
            t = mix(p.part == SCALES_GAP ? 1.0 : 0.0, t, smoothstep(0.0, 0.15, abs(lifted - best)));
        }
        best = max(best, lifted);
    }
    return t;
}
