// One direction of a Gaussian of seven taps, one standard deviation apart, as wide on the surface as the texels there
// are small [dEon2007, listing 14-4].
#include "lib/fetch.glsl"

void main() {
    vec2 size = vec2(textureSize(image, 0));
    vec2 at = gl_FragCoord.xy / size;
    vec4 here = fetch(stretch, ivec2(gl_FragCoord.xy));
    float texels = here.a > p.least ? p.sigma * (p.along == 0 ? here.y : here.z) / here.a : 0.0;
    vec2 step = min(texels, p.widest) * (p.along == 0 ? vec2(1.0, 0.0) : vec2(0.0, 1.0)) / size;
    vec4 sum = vec4(0.0);
    float total = 0.0;
    for (int k = -3; k <= 3; ++k) {
        float weight = exp(-0.5 * float(k * k));
        total += weight;
        sum += weight * textureLod(image, at + float(k) * step, 0.0);
    }
    blurred = sum / total;
}
