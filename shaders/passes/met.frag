// A cube in which the picture sees a surface.
void main() {
    met = vec4(1.0);
}
