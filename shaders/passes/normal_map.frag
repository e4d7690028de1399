// The slope of a skin as a tangent-space normal: x along u, y across it towards v, z outwards.
#include "lib/fetch.glsl"

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 rise = fetch(slope, texel);
    vec4 metric = p.extent > 0.0 ? vec4(p.extent, 0.0, p.extent, 0.0) : fetch(metric_map, texel);
    float along = max(metric.x, 1e-9);
    float across = max(abs(metric.z), 1e-9);
    float tangent = rise.x / along;
    float bitangent = (rise.y - metric.y * tangent) / across;
    vec2 tilt = bool(metric.x > 0.0) ? vec2(tangent, bitangent) + rise.zw : vec2(0.0);
    normal = vec4(vec3(-tilt, 1.0) / sqrt(1.0 + dot(tilt, tilt)), 1.0);
}
