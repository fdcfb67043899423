// Copies a picture to the screen: in another size, mirrored, and turned by quarters.
#version 330 core
uniform sampler2D picture;
uniform vec2 size;      // of the target in pixels
uniform bool mirrored;  // left and right change places
uniform int quarters;   // of a turn to the right
out vec4 colour;

void main() {
    vec2 at = gl_FragCoord.xy / size;
    if (quarters == 1) at = vec2(1.0 - at.y, at.x);
    else if (quarters == 2) at = 1.0 - at;
    else if (quarters == 3) at = vec2(at.y, 1.0 - at.x);
    if (mirrored) at.x = 1.0 - at.x;
    colour = vec4(texture(picture, at).rgb, 1.0);
}
