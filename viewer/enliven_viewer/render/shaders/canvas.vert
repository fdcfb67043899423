// Flat shapes and text over the picture; positions in pixels from the top left.
#version 330 core
uniform vec2 viewport;
in vec2 in_position;
in vec2 in_uv;
in vec4 in_tint;
in vec3 in_box;  // half width, half height, corner radius in pixels; radius < 0: a glyph
out vec2 uv;
out vec4 tint;
flat out vec3 box;

void main() {
    uv = in_uv;
    tint = in_tint;
    box = in_box;
    gl_Position = vec4(in_position / viewport * vec2(2.0, -2.0) + vec2(-1.0, 1.0), 0.0, 1.0);
}
