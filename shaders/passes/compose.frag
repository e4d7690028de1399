// Equation 2 of [Fecko2013]: what left the skin, what it threw back, what it mirrors.
#include "lib/fetch.glsl"

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float covered = fetch(depth, pixel).r > 0.0 ? 1.0 : 0.0;
    vec2 place = p.in_atlas == 1 ? fetch(uv, pixel).zw : gl_FragCoord.xy / vec2(textureSize(diffused, 0));
    vec4 light = texture(diffused, place);
    // A bilinear read at a chart's border meets texels of no surface: the average of the others is meant.
    vec3 left_skin = p.normalize == 1 ? light.rgb / max(light.a, 1e-4) : light.rgb;
    left_skin *= p.scale * covered;
    vec3 color = fetch(albedo, pixel).rgb;
    float open = fetch(occlusion, pixel).r;
    vec3 shine = fetch(specular, pixel).rgb;
    vec3 mirrored = fetch(reflection, pixel).rgb;
    diffuse = vec4(left_skin, covered);
    vec3 highlight = mix(shine, shine * color, p.tint_highlights);
    // What the color has not yet taken on the way in.
    vec3 way_out = p.way_out == 2 ? color : p.way_out == 1 ? sqrt(max(color, 0.0)) : vec3(1.0);
    beauty = vec4(covered * (left_skin * open * way_out + highlight + mirrored), covered);
}
