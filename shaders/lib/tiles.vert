// One point over each tile of the target that is wanted; a constant 1 wants all of them.
uniform sampler2D seen;

void main() {
    ivec2 tile = ivec2(gl_VertexID % TILES.x, gl_VertexID / TILES.x);
    bool wanted = texelFetch(seen, min(tile, textureSize(seen, 0) - 1), 0).r > 0.0;
    gl_Position = wanted ? vec4((vec2(tile) + 0.5) / vec2(TILES) * 2.0 - 1.0, 0.0, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
    gl_PointSize = float(TILE);
}
