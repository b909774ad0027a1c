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

ivec3 slab_t(vec3 point) {
    PRECISE vec3 t = (point - slab_origin) * slab_inverse;
    return floatBitsToInt(t);
}

float slab_entry(vec3 lower, vec3 upper) {
    return slab_first(min(slab_t(lower), slab_t(upper)));
}

float slab_exit(vec3 lower, vec3 upper) {
    return slab_last(max(slab_t(lower), slab_t(upper)));
}
