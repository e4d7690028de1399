// Phong highlights, one additive pass per light, apart from the light that enters the skin [Fecko2013, section 3.1].
#include "lib/fetch.glsl"
#include "lib/light.glsl"
#include "lib/camera.glsl"

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 N = fetch(normal, pixel);
    int slot = int(N.w);
    if (slot == 0) {
        specular = vec4(0.0);
        return;
    }
    vec4 gloss = p.gloss[slot - 1];  // x: strength, y: shininess
    vec3 c = camera_position(pixel, fetch(depth, pixel).r);
    vec3 from_eye = c.x * p.right + c.y * p.up + c.z * p.forward;
    vec3 V = -from_eye / sqrt(max(dot(from_eye, from_eye), 1e-12));
    Lit lit = light_at(p.eye + from_eye);
    vec3 R = reflect(-lit.L, N.xyz);
    float RoV = dot(R, V);
    float lobe = RoV > 0.0 && dot(N.xyz, lit.L) > 0.0 ? exp2(gloss.y * log2(max(RoV, 1e-30))) : 0.0;
    specular = vec4(p.scale * gloss.x * lobe * lit.irradiance, 0.0);
}
