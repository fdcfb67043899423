// A line where a ghost ends, and where a part of it lies well before another; a faint veil inside.
#version 330 core
uniform sampler2D picture;  // metres before the eye, 0 where there is nothing
uniform vec4 tint;
uniform float radius;  // pixels
uniform float jump;    // metres between two parts
out vec4 colour;

const int TAPS = 12;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy), last = textureSize(picture, 0) - 1;
    float here = texelFetch(picture, at, 0).r;
    float other = 0.0;
    for (int k = 0; k < TAPS; k++) {
        float angle = 6.2831853 * float(k) / float(TAPS);
        for (int ring = 1; ring <= 2; ring++) {
            vec2 way = vec2(cos(angle), sin(angle)) * radius * float(ring) * 0.5;
            float there = texelFetch(picture, clamp(at + ivec2(round(way)), ivec2(0), last), 0).r;
            bool ends = (there > 0.0) != (here > 0.0);
            other += ends || abs(there - here) > jump ? 0.5 : 0.0;
        }
    }
    float line = smoothstep(0.04, 0.34, other / float(TAPS));
    float veil = here > 0.0 ? 0.06 : 0.0;
    colour = vec4(tint.rgb, tint.a * max(line, veil));
}
