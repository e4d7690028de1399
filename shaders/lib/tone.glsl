// Khronos 2024, "PBR Neutral Tone Mapper": keeps colors below its start as they are and bends highlights to white.
// Its toe is left out: it takes off the 4 % that a dielectric reflects under uniform light, which would only darken
// and saturate the shadows here. p.start and p.desaturation come from skincli/color.py.
vec3 neutral_display(vec3 color) {
    float peak = max(color.r, max(color.g, color.b));
    if (peak < p.start) {
        return color;
    }
    float d = 1.0 - p.start;
    float bent = 1.0 - d * d / (peak + d - p.start);
    color *= bent / peak;
    float g = 1.0 - 1.0 / (p.desaturation * (peak - bent) + 1.0);
    return mix(color, vec3(bent), g);
}
