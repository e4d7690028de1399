// Khronos 2024, "PBR Neutral Tone Mapper" specification: keeps colors below 0.8 as they are and bends highlights to white.
vec3 neutral_display(vec3 color) {
    const float START = 0.8 - 0.04;
    const float DESATURATION = 0.15;
    float x = min(color.r, min(color.g, color.b));
    float offset = x < 0.08 ? x - 6.25 * x * x : 0.04;  // 0.04: Fresnel reflection of common materials
    color -= offset;
    float peak = max(color.r, max(color.g, color.b));
    if (peak < START) {
        return color;
    }
    float d = 1.0 - START;
    float bent = 1.0 - d * d / (peak + d - START);
    color *= bent / peak;
    float g = 1.0 - 1.0 / (DESATURATION * (peak - bent) + 1.0);
    return mix(color, vec3(bent), g);
}
