// A tile of the atlas that the picture reads.
void main() {
    seen = vec4(1.0);
}
