// Tiles of the atlas with a texel in a cube near what the picture sees.
#include "lib/cubes.glsl"

void main() {
    ivec2 corner = ivec2(gl_FragCoord.xy) * TILE;
    float found = 0.0;
    for (int k = 0; k < TILE * TILE && found == 0.0; ++k) {
        vec4 P = texelFetch(position, corner + ivec2(k % TILE, k / TILE), 0);
        found = P.w > 0.0 ? texelFetch(near, place_of(number_of(cube_of(P.xyz))), 0).r : 0.0;
    }
    wanted = vec4(found);
}
