// The stack of texture layers, fused into one draw per group of maps.
#include "lib/fetch.glsl"
#include "lib/site.glsl"
#include "generated/layers"

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    Site site;
    site.uv = gl_FragCoord.xy * p.texel;
    site.footprint_uv = p.texel;
    if (p.on_surface == 1) {
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
    vec4 baked = fetch(site_baked, texel);
    site.occlusion = baked.x;
    site.curvature = baked.y;
    site.height = 0.0;
    Generated map = generate(site);
    albedo = vec4(map.albedo, 1.0);
    height = vec4(map.height);
    reflectance = vec4(map.reflectance);
    roughness = vec4(map.roughness);
    specular = vec4(map.specular);
    scattering_radius = vec4(map.scattering_radius, 1.0);
    tangent_slope = vec4(map.slope, 0.0, 0.0);
}
