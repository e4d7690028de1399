// Cubes of space in a texture, those of one z side by side, and above them a flag: see skincli/passes/near.py.
ivec3 cube_of(vec3 P) {
    return ivec3(clamp(floor((P - p.low) / p.side), vec3(0.0), p.count - 1.0));
}

ivec2 grid_size() {
    return ivec2(int(p.count.x * p.count.z), int(p.count.y) + 1);
}

ivec2 flag() {
    return ivec2(0, int(p.count.y));
}

int number_of(ivec3 cube) {
    return (cube.z * int(p.count.y) + cube.y) * int(p.count.x) + cube.x;
}

ivec2 place_of(int number) {
    int across = int(p.count.x);
    int high = int(p.count.y);
    return ivec2(number % across + across * (number / (across * high)), number / across % high);
}
