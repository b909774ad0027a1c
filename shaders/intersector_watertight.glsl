#include "common_areas.glsl"

// Woop, Benthin and Wald 2013: corners relative to the origin are sheared until the ray is the z axis, and the signs of
// three areas in the plane tell whether the axis passes through. A corner's place depends on the ray and the corner
// alone and the signs are exact, so triangles that share an edge agree about it: a closed surface has no holes.
// Two-sided and closed: a ray through an edge or a vertex hits every triangle that has it. A triangle whose areas are
// all 0 is not hit.
uniform vec3 scene_lower;
uniform vec3 scene_upper;

const int TEST_WORDS = TRIANGLE_WORDS;

bool shear_from_x;  // the axis along which the ray moves most
bool shear_from_y;
vec2 shear;
float shear_depth;

// Axes in cyclic order, that of the shear last.
vec3 shear_axes(vec3 v) {
    return shear_from_x ? v.yzx : shear_from_y ? v.zxy : v;
}

// Let eps = 2^-24. With divisions off by 2.5 ulp, the most that ES 3.1 allows, a sheared coordinate is wrong by
// 2 eps |A_x| + 9 eps |shear A_z|, and the slab test by 7 eps |A_x|. The boxes grow by more than both, taken at the
// scene's farthest corners, and by what adding that to the origin rounds (ARCHITECTURE.md, Why no traversal loses a hit).
const float SHEAR_GROWTH = 7.1525574e-7;  // 12 eps
const float SHEAR_ROUNDING = 6.0e-8;      // more than eps
const float SHEAR_LEAST = 3.4694470e-18;  // 2^-58: more than a ray moves that the slab test takes to stand still
const float SHEAR_SMALL = 8.6736174e-19;  // 2^-60
const float SHEAR_LARGE = 1.1529215e18;   // 2^60

void intersector_prepare() {
    vec3 size = abs(ray_direction);
    shear_from_x = size.x >= max(size.y, size.z);
    shear_from_y = !shear_from_x && size.y >= size.z;
    vec3 along = shear_axes(ray_direction);
    shear_depth = along.z;
    PRECISE vec2 slope = along.xy * (1.0 / along.z);
    shear = slope;
    vec3 reach = max(abs(scene_lower - ray_origin), abs(scene_upper - ray_origin));
    vec3 steep = max(size / abs(shear_depth), vec3(SHEAR_LEAST));
    slab_grow(SHEAR_GROWTH * (reach + steep * shear_axes(reach).z) + SHEAR_ROUNDING * abs(ray_origin));
}

void intersect(uint slot) {
    vec3 a, b, c;
    uint id;
    fetch_triangle(slot, a, b, c, id);
    PRECISE vec3 to_a = shear_axes(a - slab_origin);
    PRECISE vec3 to_b = shear_axes(b - slab_origin);
    PRECISE vec3 to_c = shear_axes(c - slab_origin);
    vec3 depths = vec3(to_a.z, to_b.z, to_c.z);
    PRECISE vec3 x = vec3(to_a.x, to_b.x, to_c.x) - ROUNDED(shear.x * depths);
    PRECISE vec3 y = vec3(to_a.y, to_b.y, to_c.y) - ROUNDED(shear.y * depths);
    vec3 areas = signed_areas(x, y);
    bool inside = all(greaterThanEqual(areas, vec3(0.0))) || all(lessThanEqual(areas, vec3(0.0)));
    // A power of two keeps what tiny areas weigh from underflowing.
    areas *= abs(areas.x + areas.y + areas.z) < SHEAR_SMALL ? SHEAR_LARGE : 1.0;
    PRECISE float total = areas.x + areas.y + areas.z;
    PRECISE float t = dot(areas, depths) / (total * shear_depth);
    vec3 lower = min(a, min(b, c));
    vec3 upper = max(a, max(b, c));
    // Within the triangle's box where the ray meets it, else within the grown one, in which every true hit lies.
    float entry = slab_first(min(slab_t(lower), slab_t(upper)));
    float leave = slab_last(max(slab_t(lower), slab_t(upper)));
    float soonest = slab_entry(lower, upper);
    float latest = slab_exit(lower, upper);
    inside = inside && total != 0.0 && t > 0.0 && soonest <= latest;
    t = entry <= leave ? clamp(t, entry, leave) : t;
    take_hit(inside, clamp(t, soonest, latest), slot, id);
}
