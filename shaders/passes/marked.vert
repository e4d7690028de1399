// One point per tile of the atlas and cube that it may name, over that cube; over the flag where there are more.
#include "lib/cubes.glsl"

uniform sampler2D first, second, third;

void main() {
    int tile = gl_VertexID / NAMED;
    int slot = gl_VertexID % NAMED;
    int width = textureSize(first, 0).x;
    ivec2 place = ivec2(tile % width, tile / width);
    vec4 numbers = slot < 4 ? texelFetch(first, place, 0)
        : slot < 8 ? texelFetch(second, place, 0)
        : texelFetch(third, place, 0);
    int number = int(numbers[slot & 3]);
    vec2 target = vec2(number < 0 ? flag() : place_of(number - 1)) + 0.5;
    vec2 size = vec2(grid_size());
    gl_Position = number == 0 ? vec4(2.0, 2.0, 2.0, 1.0) : vec4(target / size * 2.0 - 1.0, 0.0, 1.0);
    gl_PointSize = 1.0;
}
