// Screen-space ambient occlusion of one band [Fecko2013, section 4.2.2]: a static set of samples around the point,
// turned by another angle at each pixel, each compared with the depth the camera saw there.
// Differs from the paper where it is silent: a blocker farther than the radius in front of the point counts less
// (no dark halo around a near object), and depths within p.bias of each other do not occlude.
#include "lib/fetch.glsl"
#include "lib/camera.glsl"
#include "lib/hash.glsl"

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float z = fetch(depth, pixel).r;
    vec4 N = fetch(normal, pixel);
    if (z <= 0.0) {
        occlusion = vec4(0.0);
        return;
    }
    vec3 P = camera_position(pixel, z);
    vec3 n = vec3(dot(N.xyz, p.right), dot(N.xyz, p.up), dot(N.xyz, p.forward));
    float angle = 6.28318530718 * hash_cell(ivec3(pixel, 0), p.seed).x;
    vec2 turn = vec2(cos(angle), sin(angle));

    // Frame about the normal [Duff et al. 2017, "Building an Orthonormal Basis, Revisited"].
    float s = n.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (s + n.z);
    float b = n.x * n.y * a;
    vec3 tangent = vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x);
    vec3 bitangent = vec3(b, s + n.y * n.y * a, -n.y);

    float pixel_mm = 2.0 * p.tan_half.y * z / p.size.y;
    float bias = p.bias * p.radius + pixel_mm;
    float occluded = 0.0;
    for (int k = 0; k < p.count; ++k) {
        vec3 o = p.samples[k].xyz;
        o.xy = vec2(turn.x * o.x - turn.y * o.y, turn.y * o.x + turn.x * o.y);
        vec3 offset = p.hemisphere == 1 ? o.x * tangent + o.y * bitangent + o.z * n : o;
        vec3 Q = P + p.radius * offset;
        if (Q.z <= 0.0) {
            continue;
        }
        vec2 at = (Q.xy / (Q.z * p.tan_half) * 0.5 + 0.5) * p.size;
        ivec2 q = ivec2(floor(at));
        bool inside = all(greaterThanEqual(q, ivec2(0))) && all(lessThan(q, ivec2(p.size)));
        float seen = inside ? texelFetch(depth, q, 0).r : 0.0;
        // Differences of depths, for those of a far camera leave no digits to the sample's own offset.
        if (seen > 0.0 && z - seen > bias - p.radius * offset.z) {
            float x = clamp(p.radius / max(z - seen, 1e-6), 0.0, 1.0);
            occluded += z - seen <= p.radius ? 1.0 : x * x * (3.0 - 2.0 * x);
        }
    }
    float open = 1.0 - occluded / float(max(p.count, 1));
    occlusion = vec4(vec3(open), 1.0);
}
