// A mesh as a shadow map or the contact map sees it.
#version 330 core
uniform mat4 clip_from_caster;
in vec3 in_position;
out float height;
out float solid;

void main() {
    height = in_position.y;
    solid = 1.0;
    gl_Position = clip_from_caster * vec4(in_position, 1.0);
}
