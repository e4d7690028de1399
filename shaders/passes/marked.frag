// A cube in which the picture reads light.
void main() {
    marked = vec4(1.0);
}
