// Long lists in textures of ROW_WIDTH texels a row (a power of two), and integers that ride in float32.
// On software GL a nearest read by coordinate costs less than half of a texelFetch.
vec4 at(sampler2D list, int index) {
    vec2 place = vec2(float(index & (ROW_WIDTH - 1)), float(index >> ROW_SHIFT)) + 0.5;
    return textureLod(list, place * vec2(1.0 / float(ROW_WIDTH), 1.0 / float(textureSize(list, 0).y)), 0.0);
}

// 30 bits of a float32 whose exponent is held within the normal range, so that no driver changes it.
uint word(float value) {
    uint bits = floatBitsToUint(value);
    return (bits & 0x1FFFFFFFu) | ((bits >> 31) << 29);
}

int own_index() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    return (texel.y << ROW_SHIFT) + texel.x;
}
