// What is too small for the texels of a map fades to its mean instead of turning into false patterns.

// 1 where a feature of `size` mm is well resolved by texels of `footprint` mm, 0 where it is not, 1/2 at two texels.
float resolved(float size, float footprint) {
    return smoothstep(1.0, 3.0, size / max(footprint, 1e-9));
}

// Stretch t so that `ends.x` becomes 0 and `ends.y` 1, smoothly; ends in falling order invert.
// `blur` is a lower bound of half the width of the step, so that a hard edge does not alias.
float levels(float t, vec2 ends, float blur) {
    float half_width = max(0.5 * abs(ends.y - ends.x), max(blur, 1e-4));
    float direction = ends.y < ends.x ? -0.5 : 0.5;
    float x = clamp(0.5 + direction * (t - 0.5 * (ends.x + ends.y)) / half_width, 0.0, 1.0);
    return x * x * (3.0 - 2.0 * x);
}
