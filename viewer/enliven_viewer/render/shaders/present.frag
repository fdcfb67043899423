#version 330 core
uniform sampler2D picture;
uniform ivec2 corner;  // of the screen, where the picture's lower left goes
out vec4 colour;

void main() {
    colour = vec4(texelFetch(picture, ivec2(gl_FragCoord.xy) - corner, 0).rgb, 1.0);
}
