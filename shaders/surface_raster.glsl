#include "common_octahedral.glsl"

// Primary visibility from the rasterised depth and normals (method hybrid): no primary ray is cast.
uniform highp sampler2D raster_depth;
uniform highp usampler2D raster_normal;
uniform vec2 depth_planes;  // near, far

bool surface_hit;
vec3 surface_point;
vec3 surface_normal;
vec3 surface_shading;

void surface_locate(ivec2 pixel) {
    float depth = texelFetch(raster_depth, pixel, 0).x;
    surface_hit = depth < 1.0;
    float z = depth_planes.x * depth_planes.y / (depth_planes.y - depth * (depth_planes.y - depth_planes.x));
    hit_t = z / dot(ray_direction, view_forward);
    hit_id = surface_hit ? NO_PRIMITIVE - 1u : NO_PRIMITIVE;
    surface_point = ray_origin + hit_t * ray_direction;
    surface_normal = octahedral_decode(texelFetch(raster_normal, pixel, 0).x);
    surface_normal *= dot(surface_normal, ray_direction) > 0.0 ? -1.0 : 1.0;
    surface_shading = surface_normal;
}

void surface_from_hit() {
}
