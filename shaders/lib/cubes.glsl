// Cubes of space in a texture: see skincli/passes/near.py.
ivec3 cube_of(vec3 P) {
    return ivec3(clamp(floor((P - p.low) / p.side), vec3(0.0), p.count - 1.0));
}

ivec2 place_of(ivec3 cube) {
    return ivec2(cube.x + int(p.count.x) * cube.z, cube.y);
}
