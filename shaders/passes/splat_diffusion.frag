// What a point of the surface gives to the pixels around it: its light and 1, by their distance in space [Shah2009].
#include "lib/fetch.glsl"
#include "lib/camera.glsl"

in vec3 v_center;
in vec2 v_atlas_uv;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float z = fetch(depth, pixel).r;
    vec3 away = camera_position(pixel, z) - v_center;
    float squared = dot(away, away);
    bool reached = z > 0.0 && squared < p.reach * p.reach;
    vec4 light = textureLod(image, v_atlas_uv, 0.0);
    splatted = reached && light.a > 0.0 ? exp(-squared / (2.0 * p.sigma * p.sigma)) * light : vec4(0.0);
}
