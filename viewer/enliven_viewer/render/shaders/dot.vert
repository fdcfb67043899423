// A round mark that faces the camera, one an instance.
#version 330 core
#include "frame.glsl"
in vec2 in_corner;
in vec4 in_centre;  // xyz metres, w radius in metres
in vec4 in_tint;    // rgb linear, a strength
uniform float least_pixels;
out vec2 corner;
out vec4 tint;

void main() {
    corner = in_corner;
    tint = in_tint;
    vec4 centre = clip_from_world * vec4(in_centre.xyz, 1.0);
    // The second row of the projection times the view has the length of the focal factor.
    float focal = length(vec3(clip_from_world[0][1], clip_from_world[1][1], clip_from_world[2][1]));
    float half_height = max(in_centre.w * focal, least_pixels * 2.0 / viewport.y * centre.w);
    vec2 offset = in_corner * half_height * vec2(viewport.y / viewport.x, 1.0);
    gl_Position = centre + vec4(offset, -0.002 * centre.w, 0.0);
}
