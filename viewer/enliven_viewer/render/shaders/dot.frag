// A bright core in a halo, added to the picture.
#version 330 core
uniform float fade;
uniform float halo;
in vec2 corner;
in vec4 tint;
out vec4 colour;

void main() {
    float r = length(corner);
    if (r > 1.0) discard;
    float edge = max(fwidth(r), 0.02);
    float core = 1.0 - smoothstep(0.30 - edge, 0.30 + edge, r);
    float glow = halo * exp(-5.0 * r * r) * (1.0 - r);
    vec3 light = tint.rgb * (core + glow) + vec3(0.45 * core);
    colour = vec4(light * tint.a * fade, 0.0);
}
