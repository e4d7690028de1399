// Camera space: x right, y up, z forward from the eye, mm. The passes that include this declare
//   vec2 p.tan_half (tangents of half the horizontal and vertical field of view), vec2 p.size (pixels).
vec3 camera_position(ivec2 pixel, float depth) {
    vec2 ndc = (vec2(pixel) + 0.5) / p.size * 2.0 - 1.0;
    return vec3(ndc * p.tan_half, 1.0) * depth;
}
