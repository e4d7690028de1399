// One point per pixel, over the tiles of the four texels that its bilinear read of the atlas meets.

uniform sampler2D depth, uv;

// The first and the last of the tiles; negative without a surface.
vec4 tiles(ivec2 pixel) {
    vec2 texel = floor(texelFetch(uv, pixel, 0).zw * p.atlas - 0.5);
    vec4 both = floor(clamp(vec4(texel, texel + 1.0), vec4(0.0), p.atlas.xyxy - 1.0) / float(TILE));
    return texelFetch(depth, pixel, 0).r > 0.0 ? both : vec4(-1.0);
}

void main() {
    int width = textureSize(uv, 0).x;
    ivec2 pixel = ivec2(gl_VertexID % width, gl_VertexID / width);
    vec4 own = tiles(pixel);
    // Most pixels read where the one before them does.
    bool known = own.x < 0.0 || (pixel.x > 0 && own == tiles(pixel - ivec2(1, 0)));
    vec2 middle = 0.5 * (own.xy + own.zw) + 0.5;
    gl_Position = known ? vec4(2.0, 2.0, 2.0, 1.0) : vec4(middle / vec2(TILES) * 2.0 - 1.0, 0.0, 1.0);
    gl_PointSize = own.xy == own.zw ? 1.0 : 2.0;
}
