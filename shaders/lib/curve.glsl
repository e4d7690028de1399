// The value at t of a curve through 8 control points: monotone cubics [FritschCarlson1980], constant beyond the ends.
// A point is x, y, slope and 1 / distance to the next, which is 0 for the last point and those that repeat it.
// Twin and numbers: skincli/layers/remap.py.
float remap_curve(float t, vec4 p0, vec4 p1, vec4 p2, vec4 p3, vec4 p4, vec4 p5, vec4 p6, vec4 p7) {
    vec4 points[8] = vec4[8](p0, p1, p2, p3, p4, p5, p6, p7);
    vec4 a = p0, b = p1;
    for (int i = 1; i < 7; i++) {
        if (t > points[i].x) {
            a = points[i];
            b = points[i + 1];
        }
    }
    float u = clamp((t - a.x) * a.w, 0.0, 1.0);
    float rise = b.y - a.y;
    float start = (b.x - a.x) * a.z;
    float end = (b.x - a.x) * b.z;
    return a.y + u * (start + u * (3.0 * rise - 2.0 * start - end + u * (start + end - 2.0 * rise)));
}
