// A mesh as a shadow map or the contact map sees it.
#version 330 core
uniform mat4 clip_from_caster;
in vec3 in_position;
#ifdef CUT
in vec4 in_uv;
in vec4 in_albedo;
out vec4 uv;
out float opaque;
#endif
out float height;
out float solid;

void main() {
    height = in_position.y;
    solid = 1.0;
#ifdef CUT
    uv = in_uv;
    opaque = in_albedo.a;
#endif
    gl_Position = clip_from_caster * vec4(in_position, 1.0);
}
