// Skins one vertex by at most four transforms; bones and graph nodes alike. Captured, not drawn.
#version 330 core
uniform sampler2D transforms;  // three RGBA32F texels a transform: the rows of world_from_rest
const int PER_ROW = 256;
in vec3 in_rest;
in vec3 in_rest_normal;
in uvec4 in_nodes;
in vec4 in_weights;
out vec3 out_position;
out vec3 out_normal;

void main() {
    vec4 rows[3] = vec4[3](vec4(0.0), vec4(0.0), vec4(0.0));
    for (int k = 0; k < 4; ++k) {
        int node = int(in_nodes[k]);
        ivec2 texel = ivec2(3 * (node % PER_ROW), node / PER_ROW);
        for (int r = 0; r < 3; ++r) rows[r] += in_weights[k] * texelFetch(transforms, texel + ivec2(r, 0), 0);
    }
    vec4 p = vec4(in_rest, 1.0);
    out_position = vec3(dot(rows[0], p), dot(rows[1], p), dot(rows[2], p));
    // The cofactor matrix is the inverse transpose but for its scale, and exists where the inverse does not.
    vec3 n = in_rest_normal;
    vec3 yz = cross(rows[1].xyz, rows[2].xyz);
    n = vec3(dot(yz, n), dot(cross(rows[2].xyz, rows[0].xyz), n), dot(cross(rows[0].xyz, rows[1].xyz), n));
    n *= dot(rows[0].xyz, yz) < 0.0 ? -1.0 : 1.0;
    float size = length(n);
    out_normal = size > 1e-12 ? n / size : in_rest_normal;
}
