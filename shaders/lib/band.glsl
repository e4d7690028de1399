// What is too small for the texels of a map fades to its mean instead of turning into false patterns.

// How much of a feature of `size` mm is left in the mean over a texel of `footprint` mm: 1 all, 0 nothing.
float resolved(float size, float footprint) {
    float ratio = footprint / max(size, 1e-9);
    return exp(-min(ratio * ratio, 80.0));
}

// Stretch t so that `ends.x` becomes 0 and `ends.y` 1, smoothly; ends in falling order invert.
// `blur` is half the width, in t, of the step that a texel makes of a hard one.
float levels(float t, vec2 ends, float blur) {
    float half_width = max(length(vec2(0.5 * (ends.y - ends.x), blur)), 1e-4);
    float direction = ends.y < ends.x ? -0.5 : 0.5;
    float x = clamp(0.5 + direction * (t - 0.5 * (ends.x + ends.y)) / half_width, 0.0, 1.0);
    return x * x * (3.0 - 2.0 * x);
}
