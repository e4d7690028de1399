// Mirror reflection of the environment, damped by the occlusion [Fecko2013, section 4.2.3].
// The texel is filtered over the directions that the pixel's neighbors reflect, so that fine bumps do not sparkle.
#include "lib/fetch.glsl"
#include "lib/camera.glsl"

const float PI = 3.14159265358979;

vec3 fetch_level(vec2 at, int level) {
    // Halved here: llvmpipe answers textureSize for one level per group of pixels, and theirs differ.
    ivec2 size = max(textureSize(environment, 0) >> level, ivec2(1));
    vec2 x = at * vec2(size) - 0.5;
    ivec2 i = ivec2(floor(x));
    vec2 f = x - vec2(i);
    int left = (i.x + size.x) % size.x;      // the panorama closes on itself
    int right = (i.x + 1 + size.x) % size.x;
    int bottom = clamp(i.y, 0, size.y - 1);  // but not across the poles
    int top = clamp(i.y + 1, 0, size.y - 1);
    vec3 low = mix(texelFetch(environment, ivec2(left, bottom), level).rgb,
                   texelFetch(environment, ivec2(right, bottom), level).rgb, f.x);
    vec3 high = mix(texelFetch(environment, ivec2(left, top), level).rgb,
                    texelFetch(environment, ivec2(right, top), level).rgb, f.x);
    return mix(low, high, f.y);
}

// How far the normal turns from this pixel to a neighbor of the same surface.
float turn_to(vec3 N, float z, ivec2 neighbor) {
    vec4 other = fetch(normal, neighbor);
    float z_other = fetch(depth, neighbor).r;
    bool same = other.w > 0.0 && abs(z_other - z) < 0.02 * z;
    return same ? length(other.xyz - N) : 0.0;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 N = fetch(normal, pixel);
    if (N.w == 0.0) {
        reflection = vec4(0.0);
        return;
    }
    float z = fetch(depth, pixel).r;
    vec3 c = camera_position(pixel, z);
    vec3 from_eye = c.x * p.right + c.y * p.up + c.z * p.forward;
    vec3 R = reflect(from_eye, N.xyz);
    R /= sqrt(max(dot(R, R), 1e-12));

    // Latitude and longitude; the center of the picture is -Z, and +X lies to its right.
    float horizontal = sqrt(R.x * R.x + R.z * R.z);
    float longitude = horizontal > 1e-7 ? atan(R.x, -R.z) : 0.0;
    vec2 at = vec2(fract(longitude / (2.0 * PI) + 0.5 + p.turn), 0.5 + atan(R.y, max(horizontal, 1e-7)) / PI);

    ivec2 last = ivec2(p.size) - 1;
    float turned = max(max(turn_to(N.xyz, z, min(pixel + ivec2(1, 0), last)),
                           turn_to(N.xyz, z, min(pixel + ivec2(0, 1), last))),
                       max(turn_to(N.xyz, z, max(pixel - ivec2(1, 0), ivec2(0))),
                           turn_to(N.xyz, z, max(pixel - ivec2(0, 1), ivec2(0)))));
    // A mirror turns the ray by twice what the normal turns.
    float texels = 2.0 * turned * float(textureSize(environment, 0).x) / (2.0 * PI);
    float level = clamp(log2(max(texels, 1.0)), 0.0, float(p.levels - 1));
    int whole = int(floor(level));
    vec3 mirrored = mix(fetch_level(at, whole), fetch_level(at, min(whole + 1, p.levels - 1)), level - float(whole));

    float open = mix(1.0, fetch(occlusion, pixel).r, p.damping);
    reflection = vec4(p.scale * fetch(reflectance, pixel).r * open * mirrored, 0.0);
}
