// Color of a skin from eight amounts of pigment. Twin and units: PigmentModel.albedo in skincli/optics/pigments.py.
#include "generated/pigments"

// a: melanin, oxyhemoglobin, deoxyhemoglobin, bilirubin; b: sulfhemoglobin, xanthommatin, reduced xanthommatin, ommin.
// Returns linear Rec.709 in 0 to 1.
vec3 pigment_albedo(vec4 a, vec4 b) {
    a = max(a, 0.0);
    b = max(b, 0.0);
    vec4 upper = vec4(a.x, b.yzw);
    vec4 deep = vec4(a.yzw, b.x);
    vec3 color = vec3(0.0);
    for (int g = 0; g < PIGMENT_GROUPS; ++g) {
        vec4 transmitted = exp(-(PIGMENT_UPPER[g] * upper));
        vec4 ratio = PIGMENT_BARE[g] + PIGMENT_DEEP[g] * deep;
        // [VanDeHulst1980], diffuse reflectance of a half-space; the ratio is above 0.
        vec4 s = sqrt(ratio / (1.0 + ratio));
        vec4 reflected = (1.0 - s) * (1.0 - 0.139 * s) / (1.0 + 1.17 * s);
        color += PIGMENT_WEIGHTS[g] * (reflected * mix(vec4(PIGMENT_GAPS), vec4(1.0), transmitted));
    }
    return max(color, 0.0);
}
