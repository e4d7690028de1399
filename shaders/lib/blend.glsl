// Blend modes of a backdrop b and a source s in 0 to 1, with a weight w. Formulas, clamping and sources of each stand
// in the table of skincli/layers/blend.py, beside the twins.

// Least divisor; see GUARD there.
const float BLEND_GUARD = 1e-6;

// A function of one channel holds for three; and a mode of two values is mixed in by weight.
#define PER_CHANNEL(MODE) vec3 MODE(vec3 b, vec3 s) { return vec3(MODE(b.x, s.x), MODE(b.y, s.y), MODE(b.z, s.z)); }
#define MIXED(MODE, KIND) KIND MODE(KIND b, KIND s, float w) { return mix(b, MODE(b, s), w); }
#define SEPARABLE(MODE) PER_CHANNEL(MODE) MIXED(MODE, float) MIXED(MODE, vec3)
#define COLORS(MODE) MIXED(MODE, float) MIXED(MODE, vec3)

float blend_normal(float b, float s) { return s; }
SEPARABLE(blend_normal)

float blend_darken(float b, float s) { return min(b, s); }
SEPARABLE(blend_darken)

float blend_multiply(float b, float s) { return b * s; }
SEPARABLE(blend_multiply)

float blend_color_burn(float b, float s) { return 1.0 - (1.0 - b) / max(max(s, 1.0 - b), BLEND_GUARD); }
SEPARABLE(blend_color_burn)

float blend_linear_burn(float b, float s) { return max(b + s - 1.0, 0.0); }
SEPARABLE(blend_linear_burn)

float blend_lighten(float b, float s) { return max(b, s); }
SEPARABLE(blend_lighten)

// In this form black leaves b exactly as it is, and rounding does not pass 1.
float blend_screen(float b, float s) { return b + s * (1.0 - b); }
SEPARABLE(blend_screen)

float blend_color_dodge(float b, float s) { return b / max(max(1.0 - s, b), BLEND_GUARD); }
SEPARABLE(blend_color_dodge)

float blend_linear_dodge(float b, float s) { return min(b + s, 1.0); }
SEPARABLE(blend_linear_dodge)

float blend_hard_light(float b, float s) { return s <= 0.5 ? 2.0 * b * s : blend_screen(b, 2.0 * s - 1.0); }
SEPARABLE(blend_hard_light)

float blend_overlay(float b, float s) { return blend_hard_light(s, b); }
SEPARABLE(blend_overlay)

float blend_soft_light(float b, float s) {
    float lighter = b <= 0.25 ? ((16.0 * b - 12.0) * b + 4.0) * b : sqrt(max(b, 0.0));
    return s <= 0.5 ? b - (1.0 - 2.0 * s) * b * (1.0 - b) : b + (2.0 * s - 1.0) * (lighter - b);
}
SEPARABLE(blend_soft_light)

float blend_vivid_light(float b, float s) {
    return s <= 0.5 ? blend_color_burn(b, 2.0 * s) : blend_color_dodge(b, 2.0 * s - 1.0);
}
SEPARABLE(blend_vivid_light)

float blend_linear_light(float b, float s) { return clamp(b + (2.0 * s - 1.0), 0.0, 1.0); }
SEPARABLE(blend_linear_light)

float blend_pin_light(float b, float s) { return s <= 0.5 ? min(b, 2.0 * s) : max(b, 2.0 * s - 1.0); }
SEPARABLE(blend_pin_light)

// Not b + s >= 1: the sum rounds, the difference of 1 and the larger number does not.
float blend_hard_mix(float b, float s) { return min(b, s) >= 1.0 - max(b, s) ? 1.0 : 0.0; }
SEPARABLE(blend_hard_mix)

float blend_difference(float b, float s) { return abs(b - s); }
SEPARABLE(blend_difference)

float blend_exclusion(float b, float s) { return b + s * (1.0 - 2.0 * b); }
SEPARABLE(blend_exclusion)

float blend_subtract(float b, float s) { return max(b - s, 0.0); }
SEPARABLE(blend_subtract)

float blend_divide(float b, float s) { return b / max(max(s, b), BLEND_GUARD); }
SEPARABLE(blend_divide)

float blend_luminosity_of(vec3 c) { return dot(c, vec3(0.3, 0.59, 0.11)); }
float blend_least(vec3 c) { return min(c.x, min(c.y, c.z)); }
float blend_greatest(vec3 c) { return max(c.x, max(c.y, c.z)); }
float blend_spread(vec3 c) { return blend_greatest(c) - blend_least(c); }

// Shift c to a luminosity, then draw it towards gray until it fits into 0 to 1.
vec3 blend_with_luminosity(vec3 c, float luminosity) {
    vec3 away = c - blend_luminosity_of(c);
    float below = luminosity / max(-blend_least(away), BLEND_GUARD);
    float above = (1.0 - luminosity) / max(blend_greatest(away), BLEND_GUARD);
    return clamp(luminosity + away * min(min(below, above), 1.0), 0.0, 1.0);
}

// Stretch c so that its least channel is 0 and its greatest the saturation; a gray becomes 0.
vec3 blend_with_saturation(vec3 c, float saturation) {
    return (c - blend_least(c)) * (saturation / max(blend_spread(c), BLEND_GUARD));
}

vec3 blend_hue(vec3 b, vec3 s) {
    return blend_with_luminosity(blend_with_saturation(s, blend_spread(b)), blend_luminosity_of(b));
}
float blend_hue(float b, float s) { return b; }
COLORS(blend_hue)

vec3 blend_saturation(vec3 b, vec3 s) {
    return blend_with_luminosity(blend_with_saturation(b, blend_spread(s)), blend_luminosity_of(b));
}
float blend_saturation(float b, float s) { return b; }
COLORS(blend_saturation)

vec3 blend_color(vec3 b, vec3 s) { return blend_with_luminosity(s, blend_luminosity_of(b)); }
float blend_color(float b, float s) { return b; }
COLORS(blend_color)

vec3 blend_luminosity(vec3 b, vec3 s) { return blend_with_luminosity(b, blend_luminosity_of(s)); }
float blend_luminosity(float b, float s) { return s; }
COLORS(blend_luminosity)

// A share w of a coat whose full thickness transmits s.
float blend_density(float b, float s, float w) { return b * pow(max(s, BLEND_GUARD), w); }
vec3 blend_density(vec3 b, vec3 s, float w) { return b * pow(max(s, BLEND_GUARD), vec3(w)); }

float blend_height_blend(float b, float s) { return s; }
SEPARABLE(blend_height_blend)

// How much a layer of height `own` covers what lies at height `below`; all mm.
float height_coverage(float own, float below, float contrast) {
    float t = clamp((own - below) / max(contrast, BLEND_GUARD) + 0.5, 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}

// The sRGB curve [IEC 61966-2-1]; 1 stays 1 exactly, which dodge and burn tell from what is just below.
float srgb_encode(float x) {
    float base = max(x, 0.0031308);
    float root = pow(base, 1.0 / 2.4);
    // A step of Newton towards root^12 = base^5: dodge and burn magnify the error of pow, several 1e-7.
    float base2 = base * base, root4 = root * root * root * root;
    root += root * (base2 * base2 * base / (root4 * root4 * root4) - 1.0) / 12.0;
    return x <= 0.0031308 ? 12.92 * x : root + 0.055 * (root - 1.0);
}
vec3 srgb_encode(vec3 x) { return vec3(srgb_encode(x.x), srgb_encode(x.y), srgb_encode(x.z)); }

float srgb_decode(float v) {
    return v <= 0.04045 ? v / 12.92 : pow((max(v, 0.04045) + 0.055) / 1.055, 2.4);
}
vec3 srgb_decode(vec3 v) { return vec3(srgb_decode(v.x), srgb_decode(v.y), srgb_decode(v.z)); }
