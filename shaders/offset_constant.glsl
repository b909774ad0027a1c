// A shadow ray starts a fixed way along the face's normal from where the ray was cut off: 1e-4 of the scene's diagonal.
uniform float shadow_offset;

vec3 offset_origin() {
    return surface_point + shadow_offset * surface_normal;
}
