// A Gaussian over straight distances in space, of the texels around: stretch and shear of the atlas drop out.
#include "lib/fetch.glsl"

void main() {
    vec4 here = fetch(position, ivec2(gl_FragCoord.xy));
    vec2 size = vec2(textureSize(light, 0));
    vec2 middle = floor(gl_FragCoord.xy / float(p.factor)) + 0.5;
    vec4 sum = vec4(0.0);
    for (int y = -p.radius; y <= p.radius; ++y) {
        for (int x = -p.radius; x <= p.radius; ++x) {
            vec2 at = (middle + vec2(x, y)) / size;
            vec3 away = textureLod(place, at, 0.0).xyz - here.xyz;
            sum += exp2(-p.falloff * dot(away, away)) * textureLod(light, at, 0.0);
        }
    }
    bool known = here.w > 0.0 && sum.a > 0.0;
    windowed = known ? vec4(sum.rgb / sum.a, 1.0) : vec4(0.0);
}
