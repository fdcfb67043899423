// One direction of a Gaussian, nine taps in five fetches between texels.
#version 330 core
uniform sampler2D source;
uniform vec2 direction;
out vec2 moments;

void main() {
    vec2 uv = gl_FragCoord.xy / vec2(textureSize(source, 0));
    moments = 0.227027 * textureLod(source, uv, 0.0).rg;
    moments += 0.316216 * (textureLod(source, uv + 1.384615 * direction, 0.0).rg
                         + textureLod(source, uv - 1.384615 * direction, 0.0).rg);
    moments += 0.070270 * (textureLod(source, uv + 3.230769 * direction, 0.0).rg
                         + textureLod(source, uv - 3.230769 * direction, 0.0).rg);
}
