// One point per pixel, over the cube of the surface that it sees.
#include "lib/cubes.glsl"

uniform sampler2D depth, uv, position;

// The place of that cube, negative without a surface; what else the pixel's bilinear read meets lies beside it.
ivec2 place_at(ivec2 pixel) {
    ivec2 size = textureSize(position, 0);
    ivec2 texel = clamp(ivec2(floor(texelFetch(uv, pixel, 0).zw * vec2(size))), ivec2(0), size - 1);
    vec4 P = texelFetch(position, texel, 0);
    return texelFetch(depth, pixel, 0).r > 0.0 && P.w > 0.0 ? place_of(cube_of(P.xyz)) : ivec2(-1);
}

void main() {
    int width = textureSize(uv, 0).x;
    ivec2 pixel = ivec2(gl_VertexID % width, gl_VertexID / width);
    ivec2 own = place_at(pixel);
    // Most pixels see the cube that the one before them does.
    bool known = own.x < 0 || (pixel.x > 0 && own == place_at(pixel - ivec2(1, 0)));
    vec2 size = vec2(p.count.x * p.count.z, p.count.y);
    gl_Position = known ? vec4(2.0, 2.0, 2.0, 1.0) : vec4((vec2(own) + 0.5) / size * 2.0 - 1.0, 0.0, 1.0);
    gl_PointSize = 1.0;
}
