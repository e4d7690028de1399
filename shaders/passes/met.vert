// One point per pixel, over the cube of the surface that it sees.
#include "lib/cubes.glsl"

uniform sampler2D depth, uv, position;

// The texel that a pixel reads, negative without a surface; others that it reads lie beside it.
ivec2 texel_of(ivec2 pixel) {
    ivec2 size = textureSize(position, 0);
    ivec2 texel = clamp(ivec2(floor(texelFetch(uv, pixel, 0).zw * vec2(size))), ivec2(0), size - 1);
    return texelFetch(depth, pixel, 0).r > 0.0 ? texel : ivec2(-1);
}

void main() {
    int width = textureSize(uv, 0).x;
    ivec2 texel = texel_of(ivec2(gl_VertexID % width, gl_VertexID / width));
    vec4 P = texelFetch(position, max(texel, ivec2(0)), 0);
    vec2 place = vec2(place_of(cube_of(P.xyz))) + 0.5;
    vec2 size = vec2(p.count.x * p.count.z, p.count.y);
    bool sees = texel.x >= 0 && P.w > 0.0;
    gl_Position = sees ? vec4(place / size * 2.0 - 1.0, 0.0, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
    gl_PointSize = 1.0;
}
