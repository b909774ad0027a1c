// Conservative box test: skips a box only if its entry lies behind its widened exit or behind the closest hit.
#if BOX_CELLS
// The faces of 16-bit boxes stay in cells, and the ray is taken to the grid: once, where each face would have to be taken
// to the scene. Cells are powers of two, so scaling rounds nothing. The origin in cells is rounded, and moved by more than
// that: up for lower faces, down for upper ones. So no box is entered later or left earlier than by its faces.
const float BOX_ROUNDING = 1.1920929e-7;  // 2^-23, of a float at least its ulp
const float BOX_STAY = 1.2207031e-4;      // 2^-13: times STILL_INVERSE beyond any t, so a still ray stays in its slab,
const float BOX_STILL = 8.2718061e-25;    // and as far outside as `slab_stay` lets it be: STILL_STAY / STILL_INVERSE
const float BOX_BEYOND = 1.2676506e30;    // 2^100
const float BOX_AWAY = 67108864.0;        // 2^26: times BOX_BEYOND beyond any t

vec3 box_above;
vec3 box_below;
vec3 box_near;
vec3 box_far;
vec3 box_inverse;

void box_prepare() {
    vec3 per_cell = uintBitsToFloat(uvec3(0x7f000000u) - floatBitsToUint(grid_cell));
    PRECISE vec3 above = (slab_above - grid_origin) * per_cell;
    PRECISE vec3 below = (slab_below - grid_origin) * per_cell;
    bvec3 still = notEqual(slab_stay, vec3(0.0));
    PRECISE vec3 scaled = slab_inverse * grid_cell;
    // Where float32 would end, an axis bounds nothing.
    vec3 steps = max(mix(abs(scaled), vec3(0.0), still), abs(ray_direction) * per_cell);
    bvec3 beyond = greaterThan(max(max(abs(above), abs(below)), steps), vec3(BOX_BEYOND));
    vec3 stay = mix(vec3(0.0), max(per_cell * BOX_STILL, vec3(BOX_STAY)), still);
    PRECISE vec3 high = above + max(abs(above) * BOX_ROUNDING, stay);
    PRECISE vec3 low = below - max(abs(below) * BOX_ROUNDING, stay);
    box_above = mix(high, vec3(BOX_BEYOND), beyond);
    box_below = mix(low, vec3(-BOX_BEYOND), beyond);
    box_near = mix(box_above, box_below, slab_backward());
    box_far = mix(box_below, box_above, slab_backward());
    vec3 away = mix(vec3(BOX_AWAY), vec3(-BOX_AWAY), slab_backward());
    box_inverse = mix(mix(scaled, slab_inverse, still), away, beyond);
}

ivec3 box_t(vec3 face, vec3 origin) {
    PRECISE vec3 t = (face - origin) * box_inverse;
    return floatBitsToInt(t);
}

float box_last(ivec3 t) {
    return intBitsToFloat(min(min(t.x, t.y), t.z));
}
#define box_lower_t(face) box_t(face, box_above)
#define box_upper_t(face) box_t(face, box_below)
#define box_near_t(face) box_t(face, box_near)
#define box_far_t(face) box_t(face, box_far)
#else
void box_prepare() {
}
#define box_lower_t slab_lower_t
#define box_upper_t slab_upper_t
#define box_near_t slab_near_t
#define box_far_t slab_far_t
#define box_last slab_last
#endif

bool box_hit(vec3 lower, vec3 upper, out float entry) {
    ivec3 lower_t = box_lower_t(lower);
    ivec3 upper_t = box_upper_t(upper);
    entry = slab_first(min(lower_t, upper_t));
    return entry <= slab_least(box_last(max(lower_t, upper_t)), hit_t) * WIDEN;
}

// The same, told which faces are the near ones.
bool box_hit_turned(vec3 near, vec3 far, out float entry) {
    entry = slab_first(box_near_t(near));
    return entry <= slab_least(box_last(box_far_t(far)), hit_t) * WIDEN;
}
