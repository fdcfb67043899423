#version 330 core
in vec3 grip;
out vec4 colour;

void main() {
    float most = max(grip.r, max(grip.g, grip.b));
    colour = vec4(pow(grip / max(most, 1e-4), vec3(1.0 / 2.2)), smoothstep(0.08, 0.55, most));
}
