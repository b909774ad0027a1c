#include "common_leaf.glsl"

// One node a visit, near child by the split axis, while-while (Aila and Laine 2009). The stack is written and read
// whether it is used or not: on a device that runs lanes in masked loops, a store that some lanes skip costs more.
const uint STACK_END = 0xffffffffu;

void trace(const bool any_hit) {
    uint stack[STACK_SIZE + 2];
    stack[0] = STACK_END;
    int top = 0;
    uint node = 0u;
    while (node != STACK_END) {
        uint first = 0u;
        uint count = 0u;
        while (node != STACK_END && count == 0u) {
            COUNT_NODE(7);
            uvec4 low = node_chunk(node, 0u);
            uvec4 high = node_chunk(node, 1u);
            float entry;
            bool hit = box_hit(node_lower(low), node_upper(high), entry);
            uint axis = node_axis(low);
            bool down = hit && axis != LEAF;
            uint near = node_child(low) + ((slab_octant >> axis) & 1u);
            stack[top + 1] = near ^ 1u;
            uint popped = stack[top];
            first = node_first(low);
            count = hit && axis == LEAF ? node_count(low) : 0u;
            COUNT_VISIT(down, count);
            node = down ? near : popped;
            top += down ? 1 : -1;
        }
        intersect_slots(first, count);
        node = any_hit && hit_id != NO_PRIMITIVE ? STACK_END : node;
    }
}
