// The slab test that decides where a ray is inside a box, monotone in the box: a larger box never has a later entry
// or an earlier exit, in float arithmetic too. Every "no traversal loses a hit" argument rests on that, so the
// arithmetic is `precise`. Exits are widened by 2 ulp where they are used (Ize 2013).
const float WIDEN = 1.00000024;
const float STILL = 8.2718061e-25;         // 2^-80: a direction component below it counts as zero
const float STILL_INVERSE = 1.3292280e36;  // 2^120
const float STILL_STAY = 1.0995116e12;     // 2^40, beyond any t
const float STILL_NUDGE = 9.4039548e-38;   // 2^-123

vec3 slab_origin;
vec3 slab_inverse;
vec3 slab_stay;
uint slab_octant;  // bits 1 to 3: the ray runs backward along x, y, z

// A ray that does not move along an axis is inside that slab for all t or for none, its faces included: a face at the
// origin is entered at 0 and, thanks to `slab_stay`, never left, and no 0 * inf arises.
void slab_prepare() {
    bvec3 still = lessThan(abs(ray_direction), vec3(STILL));
    slab_inverse = mix(1.0 / ray_direction, vec3(STILL_INVERSE), still);
    slab_stay = mix(vec3(0.0), vec3(STILL_STAY), still);
    // The nudge is far below an ulp: it only keeps Mesa from loading the eye's uniform again in every step.
    slab_origin = ray_origin + slab_stay * STILL_NUDGE;
    bvec3 backward = lessThan(slab_inverse, vec3(0.0));
    slab_octant = (uint(backward.x) << 1) | (uint(backward.y) << 2) | (uint(backward.z) << 3);
}

float slab_entry(vec3 lower, vec3 upper) {
    PRECISE vec3 a = (lower - slab_origin) * slab_inverse;
    PRECISE vec3 b = (upper - slab_origin) * slab_inverse;
    vec3 t = min(a, b);
    return max(max(t.x, t.y), max(t.z, 0.0));
}

float slab_exit(vec3 lower, vec3 upper) {
    PRECISE vec3 a = (lower - slab_origin) * slab_inverse;
    PRECISE vec3 b = (upper - slab_origin) * slab_inverse;
    PRECISE vec3 t = max(a, b) + slab_stay;
    return min(min(t.x, t.y), t.z);
}
