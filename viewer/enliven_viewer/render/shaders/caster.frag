// Writes depth and its square for the shadow, or closeness to the floor for the contact map.
#version 330 core
uniform bool contact;
in float height;
in float solid;
#ifdef CUT
uniform sampler2D base_map;
uniform float cutoff;
in vec4 uv;
in float opaque;
#endif
out vec2 moments;

void main() {
    // A faint caster is a screen of holes that the blur turns into a faint shadow.
    int cell = (int(gl_FragCoord.x) & 1) * 2 + (int(gl_FragCoord.x + gl_FragCoord.y) & 1);
    float cover = solid;
#ifdef CUT
    cover = opaque;
#ifdef BASE_MAP
    cover *= texture(base_map, BASE_MAP).a;
#endif
#ifdef MASK
    cover = cover < cutoff ? 0.0 : 1.0;
#endif
#endif
    if (cover < (float(cell) + 0.5) / 4.0) discard;
    float z = gl_FragCoord.z;
    moments = contact ? vec2(exp(-max(height, 0.0) / 0.16), 0.0) : vec2(z, z * z);
}
