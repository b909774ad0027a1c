#define SKIP_HIT box_hit_turned
#include "common_skip.glsl"

// The nodes lie in eight orders, one for each octant of directions, so that near children go first without a stack.
void trace(const bool any_hit) {
    skip_walk(node_copy(slab_octant >> 1), any_hit);
}
