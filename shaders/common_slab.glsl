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
const uint OCTANT_BITS = 14u;

// A ray that does not move along an axis is inside that slab for all t or for none, its faces included: a face at the
// origin is entered at 0 and, thanks to `slab_stay`, never left, and no 0 * inf arises.
void slab_prepare() {
    bvec3 still = lessThan(abs(ray_direction), vec3(STILL));
    slab_inverse = mix(1.0 / ray_direction, vec3(STILL_INVERSE), still);
    slab_stay = mix(vec3(0.0), vec3(STILL_STAY), still);
    // The factor rounds to 1: it only keeps Mesa from loading the eye's uniform again in every step.
    slab_origin = ray_origin * (1.0 + slab_stay * STILL_NUDGE);
    bvec3 backward = lessThan(slab_inverse, vec3(0.0));
    slab_octant = (uint(backward.x) << 1) | (uint(backward.y) << 2) | (uint(backward.z) << 3);
}

bvec3 slab_backward() {
    return notEqual((uvec3(slab_octant) >> uvec3(1u, 2u, 3u)) & 1u, uvec3(0u));
}

// Where min() must look for NaN, an integer comparison need not. As integers, floats of which at least one is not
// negative compare as floats do; of negative ones any will do, since entries are cut off at 0 and exits below 0 miss.
float slab_first(ivec3 t) {
    return intBitsToFloat(max(max(t.x, t.y), max(t.z, 0)));
}

float slab_last(ivec3 t) {
    PRECISE vec3 last = intBitsToFloat(t) + slab_stay;
    ivec3 bits = floatBitsToInt(last);
    return intBitsToFloat(min(min(bits.x, bits.y), bits.z));
}

float slab_least(float a, float b) {
    return intBitsToFloat(min(floatBitsToInt(a), floatBitsToInt(b)));
}

ivec3 slab_along(vec3 away) {
    PRECISE vec3 t = away * slab_inverse;
    return floatBitsToInt(t);
}

ivec3 slab_t(vec3 point) {
    PRECISE vec3 away = point - slab_origin;
    return slab_along(away);
}

// An intersector that errs by more than the widening covers has boxes grown by a length that depends on the ray:
// their lower faces are seen from a little above the origin, their upper faces from below it (Woop et al. 2013).
#if SLAB_GROWN
vec3 slab_above;
vec3 slab_below;

vec3 slab_near;
vec3 slab_far;

void slab_grow(vec3 by) {
    PRECISE vec3 above = slab_origin + by;
    PRECISE vec3 below = slab_origin - by;
    slab_above = above;
    slab_below = below;
    slab_near = mix(above, below, slab_backward());
    slab_far = mix(below, above, slab_backward());
}

ivec3 slab_lower_t(vec3 lower) {
    PRECISE vec3 t = (lower - slab_above) * slab_inverse;
    return floatBitsToInt(t);
}

ivec3 slab_upper_t(vec3 upper) {
    PRECISE vec3 t = (upper - slab_below) * slab_inverse;
    return floatBitsToInt(t);
}

ivec3 slab_near_t(vec3 face) {
    PRECISE vec3 t = (face - slab_near) * slab_inverse;
    return floatBitsToInt(t);
}

ivec3 slab_far_t(vec3 face) {
    PRECISE vec3 t = (face - slab_far) * slab_inverse;
    return floatBitsToInt(t);
}
#else
#define slab_above slab_origin
#define slab_below slab_origin
#define slab_lower_t slab_t
#define slab_upper_t slab_t
#define slab_near_t slab_t
#define slab_far_t slab_t
#endif

float slab_entry(vec3 lower, vec3 upper) {
    return slab_first(min(slab_lower_t(lower), slab_upper_t(upper)));
}

float slab_exit(vec3 lower, vec3 upper) {
    return slab_last(max(slab_lower_t(lower), slab_upper_t(upper)));
}

// Where a ray enters the box around three points, and where it leaves it, widened. For rays that run alike (SLAB_ALIKE) the
// nearer and the farther faces are found once: rounding keeps order, so these are the same bits. `away` is `a` less the origin.
void slab_cross(vec3 a, vec3 b, vec3 c, vec3 away, out float entry, out float leave) {
#if SLAB_ALIKE
    vec3 lower = mix(a, b, lessThan(b, a));
    vec3 upper = mix(a, b, greaterThan(b, a));
    lower = mix(lower, c, lessThan(c, lower));
    upper = mix(upper, c, greaterThan(c, upper));
    ivec3 first = slab_t(mix(lower, upper, slab_backward()));
    // A face behind the origin counts before one at -0, as it does below.
    ivec3 last = max(first, slab_t(mix(upper, lower, slab_backward())));
#else
    ivec3 at_a = slab_along(away);
    ivec3 at_b = slab_t(b);
    ivec3 at_c = slab_t(c);
    ivec3 first = min(at_a, min(at_b, at_c));
    ivec3 last = max(at_a, max(at_b, at_c));
#endif
    entry = slab_first(first);
    PRECISE float widened = slab_last(last) * WIDEN;
    leave = widened;
}
