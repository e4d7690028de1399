// The stack of texture layers, fused into one draw per group of maps.
#include "lib/site.glsl"
#include "generated/layers"

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    Site site;
    site.uv = gl_FragCoord.xy * p.texel;
    if (p.on_mesh == 1) {
        vec4 P = texelFetch(site_position, texel, 0);
        vec4 N = texelFetch(site_normal, texel, 0);
        site.position = P.xyz;
        site.normal = N.xyz;
        site.footprint = N.w;
    } else {
        site.position = vec3(site.uv * p.extent, 0.0);
        site.normal = vec3(0.0, 0.0, 1.0);
        site.footprint = p.texel * p.extent;
    }
    vec3 color;
    float level;
    float mirror;
    vec2 tilt;
    generate(site, color, level, mirror, tilt);
    albedo = vec4(color, 1.0);
    height = vec4(level);
    reflectance = vec4(mirror);
    tangent_slope = vec4(tilt, 0.0, 0.0);
}
