// The cubes in which a tile of the atlas that the picture reads has texels: up to twelve numbers from 1 on, 0 for none; a
// negative one says that there are more.
#include "lib/cubes.glsl"

void main() {
    ivec2 tile = ivec2(gl_FragCoord.xy);
    first = second = third = vec4(0.0);
    int count = 0;
    const vec4 slot = vec4(0.0, 1.0, 2.0, 3.0);
    for (int k = texelFetch(seen, tile, 0).r > 0.0 ? 0 : TILE * TILE; k < TILE * TILE; ++k) {
        vec4 P = texelFetch(position, tile * TILE + ivec2(k % TILE, k / TILE), 0);
        vec4 number = vec4(number_of(cube_of(P.xyz)) + 1);
        bool known = any(equal(first, number)) || any(equal(second, number)) || any(equal(third, number));
        if (P.w > 0.0 && !known) {
            first = mix(first, number, equal(slot, vec4(count)));
            second = mix(second, number, equal(slot, vec4(count - 4)));
            third = mix(third, number, equal(slot, vec4(count - 8)));
            ++count;
        }
    }
    if (count > NAMED) {
        first.x = -1.0;
    }
}
