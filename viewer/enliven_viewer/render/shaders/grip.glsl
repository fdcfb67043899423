// The light of the performers' hold on a vertex, by the transforms that it follows.
uniform sampler2D held;  // light on each transform
in uvec4 in_nodes;
in vec4 in_weights;

vec3 held_light() {
    vec3 light = vec3(0.0);
    for (int k = 0; k < 4; ++k) {
        int node = int(in_nodes[k]);
        light += in_weights[k] * texelFetch(held, ivec2(node % 256, node / 256), 0).rgb;
    }
    return light;
}
