// A texel of an input that may be a 1x1 constant, which stands for the same value everywhere.
vec4 fetch(sampler2D image, ivec2 texel) {
    return texelFetch(image, min(texel, textureSize(image, 0) - 1), 0);
}
