// The slab test that decides where a ray is inside a box, monotone in the box: a larger box never has a later entry
// or an earlier exit, in float arithmetic too. Every "no traversal loses a hit" argument rests on that, so the
// arithmetic is `precise`. The exit is widened by 2 ulp (Ize 2013).
const float WIDEN = 1.00000024;
const float STILL = 8.2718061e-25;           // 2^-80: a direction component below it counts as zero
const float STILL_INVERSE = 7.9228163e28;    // 2^96
const float STILL_SLACK = 2.3841858e-7;      // 2^-22, relative
const float STILL_SLACK_MIN = 8.6736174e-19; // 2^-60, absolute

vec3 slab_inverse;
vec3 slab_entry_origin;
vec3 slab_exit_origin;
bvec3 slab_backward;
uint slab_octant;  // bits 1 to 3: the ray runs backward along x, y, z

// A ray that does not move along an axis is inside that slab for all t or none, its faces included: the origin is
// nudged past the faces, once for entries and once for exits, and no 0 * inf arises.
void slab_prepare() {
    bvec3 still = lessThan(abs(ray_direction), vec3(STILL));
    slab_inverse = mix(1.0 / ray_direction, vec3(STILL_INVERSE), still);
    vec3 slack = max(abs(ray_origin) * STILL_SLACK, vec3(STILL_SLACK_MIN));
    slab_entry_origin = mix(ray_origin, ray_origin + slack, still);
    slab_exit_origin = mix(ray_origin, ray_origin - slack, still);
    slab_backward = lessThan(slab_inverse, vec3(0.0));
    slab_octant = (uint(slab_backward.x) << 1) | (uint(slab_backward.y) << 2) | (uint(slab_backward.z) << 3);
}

float slab_entry(vec3 lower, vec3 upper) {
    PRECISE vec3 t = (mix(lower, upper, slab_backward) - slab_entry_origin) * slab_inverse;
    return max(max(t.x, t.y), max(t.z, 0.0));
}

float slab_exit(vec3 lower, vec3 upper) {
    PRECISE vec3 t = (mix(upper, lower, slab_backward) - slab_exit_origin) * slab_inverse;
    return min(min(t.x, t.y), t.z);
}
