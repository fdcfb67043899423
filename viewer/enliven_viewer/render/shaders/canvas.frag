#version 330 core
uniform sampler2D glyphs;
in vec2 uv;
in vec4 tint;
flat in vec3 box;
out vec4 colour;

void main() {
    float cover;
    if (box.z < 0.0) {
        cover = texelFetch(glyphs, ivec2(uv), 0).r;
    } else {
        vec2 q = abs(uv) - box.xy + box.z;
        float outside = length(max(q, 0.0)) + min(max(q.x, q.y), 0.0) - box.z;
        cover = clamp(0.5 - outside, 0.0, 1.0);
    }
    colour = vec4(tint.rgb, tint.a * cover);
}
