// A ghost: a mesh as it was, or will be.
#version 330 core
#include "frame.glsl"
in vec3 in_position;
in vec3 in_normal;
out vec3 position;
out vec3 normal;

void main() {
    position = in_position;
    normal = in_normal;
    gl_Position = clip_from_world * vec4(in_position, 1.0);
    gl_Position.z += 3e-4 * gl_Position.w;  // what did not move covers its ghost
}
