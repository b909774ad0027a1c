#include "common_leaf.glsl"

// Both children are tested at their parent, the near one by the split axis goes first, while-while (Aila and Laine
// 2009). What is kept of a node is its link word, so leaves are not fetched again. The stack is written and read
// whether it is used or not: where lanes run in masked loops, a store that some of them skip costs more.
const uint STACK_END = 0xfffffffcu;  // the link of a leaf that no tree has

void trace(const bool any_hit) {
    COUNT_NODE(7);
    uvec4 root = node_chunk(0u, 0u);
    float entry;
    bool entered = box_hit(node_lower(root), node_upper(node_chunk(0u, 1u)), entry);
    uint stack[STACK_SIZE + 2];
    stack[0] = STACK_END;
    int top = 0;  // where the next popped link lies
    uint link = entered ? root.w : STACK_END;
    while (link != STACK_END) {
        while (node_axis(uvec4(link)) != LEAF) {
            COUNT_NODE(7);
            COUNT_NODE(7);
            COUNT_VISIT(true, 0u);
            uint child = node_child(uvec4(link)) + ((slab_octant >> node_axis(uvec4(link))) & 1u);
            uvec4 near = node_chunk(child, 0u);
            uvec4 far = node_chunk(child ^ 1u, 0u);
            bool near_hit = box_hit(node_lower(near), node_upper(node_chunk(child, 1u)), entry);
            bool far_hit = box_hit(node_lower(far), node_upper(node_chunk(child ^ 1u, 1u)), entry);
            uint popped = stack[top];
            stack[top + 1] = far.w;
            link = near_hit ? near.w : far_hit ? far.w : popped;
            top += int(near_hit) + int(far_hit) - 1;
        }
        uint count = link == STACK_END ? 0u : node_count(uvec4(link));
        COUNT_VISIT(false, count);
        intersect_slots(node_first(uvec4(link)), count);
        bool over = link == STACK_END || (any_hit && hit_id != NO_PRIMITIVE);
        link = over ? STACK_END : stack[max(top, 0)];
        top -= 1;
    }
}
