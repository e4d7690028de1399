// One point over each tile of the target that is wanted.
uniform sampler2D seen;

void main() {
    ivec2 tile = ivec2(gl_VertexID % TILES.x, gl_VertexID / TILES.x);
    ivec2 end = textureSize(seen, 0) - 1;
    ivec2 first = min(tile * TILE * FACTOR / SEEN_TILE, end);
    ivec2 last = min(((tile + 1) * TILE * FACTOR - 1) / SEEN_TILE, end);
    float wanted = 0.0;
    for (int y = first.y; y <= last.y; ++y) {
        for (int x = first.x; x <= last.x; ++x) {
            wanted = max(wanted, texelFetch(seen, ivec2(x, y), 0).r);
        }
    }
    gl_Position = wanted > 0.0 ? vec4((vec2(tile) + 0.5) / vec2(TILES) * 2.0 - 1.0, 0.0, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
    gl_PointSize = float(TILE);
}
