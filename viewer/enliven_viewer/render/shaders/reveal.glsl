// Where the performer's body is inside a mesh (KinEtre, section 5: the mesh turns partly transparent there).
layout(std140) uniform Bones {
    vec4 bone_from[64];  // xyz metres, w radius
    vec4 bone_to[64];    // xyz metres, w radius
    vec4 bone_shown[64]; // x in [0, 1]: confidence times the overlay's strength
};
uniform int bone_count;
uniform float reveal_distance;
uniform float reveal_opacity;

float embodied(vec3 p) {
    float most = 0.0;
    for (int i = 0; i < bone_count; ++i) {
        vec3 along = bone_to[i].xyz - bone_from[i].xyz;
        vec3 off = p - bone_from[i].xyz;
        float t = clamp(dot(off, along) / max(dot(along, along), 1e-8), 0.0, 1.0);
        float outside = length(off - t * along) - mix(bone_from[i].w, bone_to[i].w, t);
        most = max(most, bone_shown[i].x * (1.0 - smoothstep(0.0, reveal_distance, outside)));
    }
    return most;
}

// Opacity of a surface: like glass where the body is inside it, its silhouette still drawn.
float opacity(vec3 n, vec3 p) {
    float inside = bone_count > 0 ? embodied(p) : 0.0;
    float grazing = 1.0 - abs(dot(n, normalize(eye.xyz - p)));
    return mix(1.0, mix(reveal_opacity, 0.75, grazing * grazing * grazing), inside);
}
