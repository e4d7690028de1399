// Cubes in which the picture reads light, and their neighbors; all of them where the flag says so.
#include "lib/cubes.glsl"

void main() {
    ivec2 place = ivec2(gl_FragCoord.xy);
    int across = int(p.count.x);
    ivec3 own = ivec3(place.x % across, place.y, place.x / across);
    ivec3 first = max(own - 1, ivec3(0));
    ivec3 last = min(own + 1, ivec3(p.count) - 1);
    float found = texelFetch(marked, flag(), 0).r;
    for (int z = first.z; z <= last.z; ++z) {
        for (int y = first.y; y <= last.y; ++y) {
            for (int x = first.x; x <= last.x; ++x) {
                found = max(found, texelFetch(marked, place_of(number_of(ivec3(x, y, z))), 0).r);
            }
        }
    }
    near = vec4(found);
}
