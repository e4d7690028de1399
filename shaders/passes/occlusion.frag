// Equation 1 of [Fecko2013], (high^a low^b)^(1/(a+b)), in a form that neither underflows nor divides by zero.
#include "lib/fetch.glsl"

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float high = fetch(occlusion_high, pixel).r;
    float low = fetch(occlusion_low, pixel).r;
    float total = p.a + p.b;
    float combined = 1.0;
    if (total > 0.0) {
        bool closed = (p.a > 0.0 && high <= 0.0) || (p.b > 0.0 && low <= 0.0);
        float logarithm = p.a * log2(max(high, 1e-30)) + p.b * log2(max(low, 1e-30));
        combined = closed ? 0.0 : exp2(logarithm / total);
    }
    occlusion = vec4(vec3(combined), 1.0);
}
