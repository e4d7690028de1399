// The average at each node, blurred irradiance over blurred area, with its gradient per half lattice constant.
#include "lib/rows.glsl"

// The average, and 1 where there is any.
vec4 average(int node) {
    vec4 sum = at(image, node);
    return sum.a > 0.0 ? vec4(sum.rgb / sum.a, 1.0) : vec4(0.0);
}

// Twice the change by a step: across both neighbors, or from the node to the only one.
vec3 change(vec3 here, float ahead, float behind) {
    vec4 after = average(int(ahead));
    vec4 before = average(int(behind));
    return (after.rgb - here) * after.a * (2.0 - before.a) + (here - before.rgb) * before.a * (2.0 - after.a);
}

void main() {
    int node = own_index();
    red = green = blue = vec4(0.0);
    if (node >= p.nodes) {
        return;
    }
    vec4 own = average(node);
    vec3 here = own.rgb;
    vec4 next = at(links, 2 * node);
    vec4 last = at(links, 2 * node + 1);
    vec3 a = change(here, next.x, last.x);
    vec3 b = change(here, next.y, last.y);
    vec3 c = change(here, next.z, last.z);
    vec3 d = change(here, next.w, last.w);
    // The directions of skincli.mesh.lattice: (1,1,1) (1,-1,1) (1,1,-1) (1,-1,-1); their squares add up to 4 each.
    vec3 x = (a + b + c + d) / 8.0;
    vec3 y = (a - b + c - d) / 8.0;
    vec3 z = (a + b - c - d) / 8.0;
    red = vec4(own.a > 0.0 ? here.r : NONE, x.r, y.r, z.r);
    green = vec4(here.g, x.g, y.g, z.g);
    blue = vec4(here.b, x.b, y.b, z.b);
}
