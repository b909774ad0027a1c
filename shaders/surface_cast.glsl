// Primary visibility by casting a ray a pixel (methods fragment and compute).
bool surface_hit;
vec3 surface_point;
vec3 surface_normal;   // of the triangle's plane, towards the eye
vec3 surface_shading;  // interpolated from the vertices where the scene has normals
vec3 surface_a;        // the triangle that was hit
vec3 surface_b;
vec3 surface_c;

void surface_locate(ivec2 pixel) {
}

void surface_from_hit() {
    surface_hit = hit_id != NO_PRIMITIVE;
    surface_point = ray_origin + hit_t * ray_direction;
    surface_normal = -ray_direction;
    surface_shading = surface_normal;
    if (surface_hit) {
        vec3 a, b, c;
        uint id;
        COUNT_WORDS(TRIANGLE_WORDS);
        fetch_triangle(hit_slot, a, b, c, id);
        surface_a = a;
        surface_b = b;
        surface_c = c;
        surface_normal = normalize(cross(normalize(b - a), normalize(c - a)));
        surface_normal *= dot(surface_normal, ray_direction) > 0.0 ? -1.0 : 1.0;
#if NORMALS
        COUNT_WORDS(NORMAL_WORDS);
        vec3 na, nb, nc;
        fetch_normals(hit_slot, na, nb, nc);
        vec3 p = cross(ray_direction, c - a);
        vec2 uv = vec2(dot(ray_origin - a, p), dot(ray_direction, cross(ray_origin - a, b - a))) / dot(b - a, p);
        surface_shading = normalize(na * (1.0 - uv.x - uv.y) + nb * uv.x + nc * uv.y);
        surface_shading *= dot(surface_shading, ray_direction) > 0.0 ? -1.0 : 1.0;
#else
        surface_shading = surface_normal;
#endif
    }
}
