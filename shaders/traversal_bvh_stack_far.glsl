// Where any hit will do, far children go first: a shadow ray starts on a surface, deep in the tree, and rays beside each other
// meet at a light, so that from there they walk alike. Other rays walk as in `traversal_bvh_stack.glsl`.
#define STACK_OCTANT(any_hit) (any_hit ? slab_octant ^ OCTANT_BITS : slab_octant)
#include "traversal_bvh_stack.glsl"
