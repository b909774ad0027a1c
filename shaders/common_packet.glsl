#include "common_begin.glsl"

// A packet: the pixels of a block share an invocation and every fetch. Each ray keeps its own state here and is put into
// the globals of `common_ray.glsl` and `common_slab.glsl` for its tests, which are those of single rays, bit for bit. The
// loops over rays have a constant length, and every index is theirs, so that compilers unroll them.
const int PACKET = PACKET_WIDTH * PACKET_HEIGHT;
const float NEVER = -1.0e38;  // the reach of a ray that is done: before every box and every hit

vec3 packet_origin[PACKET];
vec3 packet_direction[PACKET];
float packet_t[PACKET];
uint packet_slot[PACKET];
uint packet_id[PACKET];
vec3 packet_slab_origin[PACKET];
vec3 packet_inverse[PACKET];
vec3 packet_stay[PACKET];
uint packet_octant[PACKET];
#if SLAB_ALIKE
uint packet_way;  // the octant of the rays that walk now
#endif
#if SLAB_GROWN
vec3 packet_above[PACKET];
vec3 packet_below[PACKET];
#endif
#if BOX_CELLS
vec3 packet_box_above[PACKET];
vec3 packet_box_below[PACKET];
vec3 packet_box_inverse[PACKET];
vec3 packet_eye_above;  // of rays from one eye, the outermost
vec3 packet_eye_below;
#endif
#if INSTRUMENT
uvec4 packet_counted[PACKET];
uint packet_words[PACKET];
#endif

vec4 packet_shown[PACKET];  // what the pixels of the block show in the end

ivec2 packet_pixel(ivec2 corner, int k) {
    return corner + ivec2(k % PACKET_WIDTH, k / PACKET_WIDTH);
}

// Keep the ray in the globals as ray k; one that is not `real` is done from the start.
void packet_keep(int k, bool real) {
    packet_origin[k] = ray_origin;
    packet_direction[k] = ray_direction;
    packet_t[k] = real ? hit_t : NEVER;
    packet_slot[k] = hit_slot;
    packet_id[k] = hit_id;
    packet_slab_origin[k] = slab_origin;
    packet_inverse[k] = slab_inverse;
    packet_stay[k] = slab_stay;
    packet_octant[k] = slab_octant;
#if SLAB_GROWN
    packet_above[k] = slab_above;
    packet_below[k] = slab_below;
#endif
#if BOX_CELLS
    packet_box_above[k] = box_above;
    packet_box_below[k] = box_below;
    packet_box_inverse[k] = box_inverse;
#endif
#if INSTRUMENT
    packet_counted[k] = uvec4(0u);
    packet_words[k] = 0u;
#endif
}

// Rays from one eye may share its place in cells, which differs where a ray stands still or goes beyond what float32 holds.
// By the outermost no box is entered later.
void packet_share() {
#if BOX_CELLS
    packet_eye_above = packet_box_above[0];
    packet_eye_below = packet_box_below[0];
    for (int k = 1; k < PACKET; k++) {
        packet_eye_above = max(packet_eye_above, packet_box_above[k]);
        packet_eye_below = min(packet_eye_below, packet_box_below[k]);
    }
#endif
}

// Ray k into the globals, as far as a box test reads them. Of rays from one eye the first one's origin stands for all: the
// same bits, and compilers see that what depends on nothing else is computed once for all rays.
void packet_aim(int k, const bool one_eye) {
    ray_origin = packet_origin[one_eye ? 0 : k];
    ray_direction = packet_direction[k];
    hit_t = packet_t[k];
    slab_origin = packet_slab_origin[one_eye ? 0 : k];
    slab_inverse = packet_inverse[k];
    slab_stay = packet_stay[k];
#if SLAB_ALIKE
    slab_octant = packet_way;
#else
    slab_octant = packet_octant[k];
#endif
#if SLAB_GROWN
    slab_above = packet_above[k];
    slab_below = packet_below[k];
#endif
#if BOX_CELLS
    box_above = one_eye ? packet_eye_above : packet_box_above[k];
    box_below = one_eye ? packet_eye_below : packet_box_below[k];
    box_inverse = packet_box_inverse[k];
#else
    box_prepare();
#endif
}

// Ray k whole: with its hit, and what the intersector prepares.
void packet_take(int k, const bool one_eye) {
    packet_aim(k, one_eye);
    hit_slot = packet_slot[k];
    hit_id = packet_id[k];
#if INSTRUMENT
    counted = packet_counted[k];
    counted_words = packet_words[k];
#endif
    intersector_prepare();
}
