// Equation 2 of [Fecko2013]: what left the skin, what it threw back, what it mirrors.
void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float covered = texelFetch(depth, pixel, 0).r > 0.0 ? 1.0 : 0.0;
    vec4 light = texture(diffused, texelFetch(uv, pixel, 0).zw);
    // A bilinear read at a chart's border meets texels of no surface: the average of the others is meant.
    vec3 left_skin = p.normalize == 1 ? light.rgb / max(light.a, 1e-4) : light.rgb;
    left_skin *= p.scale * covered;
    vec3 color = texelFetch(albedo, pixel, 0).rgb;
    float open = texelFetch(occlusion, pixel, 0).r;
    vec3 shine = texelFetch(specular, pixel, 0).rgb;
    vec3 mirrored = texelFetch(reflection, pixel, 0).rgb;
    diffuse = vec4(left_skin, covered);
    vec3 highlight = mix(shine, shine * color, p.tint_highlights);
    beauty = vec4(covered * (left_skin * open * color + highlight + mirrored), covered);
}
