#include "common_enter.glsl"

// The octant by which near and far children are told apart.
#ifndef STACK_OCTANT
#define STACK_OCTANT(any_hit) slab_octant
#endif

// The stack walk: both children are tested at their parent, the near one by the split axis goes first, while-while (Aila
// and Laine 2009). What is kept of a node is its link word, so leaves are not fetched again. A traversal says what else
// waits with a link, `stack_wait`, and which entries need no visit once a leaf is done, `stack_pass`. The stack is
// written and read whether it is used or not: where lanes run in masked loops, a store that some of them skip costs more.
// Loops test at their end, for there a test before the first turn costs a turn in which no lane does anything.
void trace(const bool any_hit) {
    uint root;
    bool entered = enters_root(root);
    uint octant = STACK_OCTANT(any_hit);
    float entry;
    stack_wait(0, STACK_END, 0.0);
    int top = 0;  // where the next popped link lies
    uint link = entered ? root : STACK_END;
    do {
        if (node_axis(link) != LEAF) {
            do {
                COUNT_VISIT(true, 0u);
                uint child = node_child(link) + ((octant >> node_axis(link)) & 1u);
                uint near, far;
                bool near_hit = enters(child, entry, near);
                bool far_hit = enters(child ^ 1u, entry, far);
                uint popped = stack[top];
                stack_wait(top + 1, far, entry);
                link = near_hit ? near : far_hit ? far : popped;
                top += int(near_hit) + int(far_hit) - 1;
            } while (node_axis(link) != LEAF);
        }
        uint count = link == STACK_END ? 0u : node_count(link);
        COUNT_VISIT(false, count);
        intersect_slots(node_first(link), count);
        bool over = link == STACK_END || (any_hit && hit_id != NO_PRIMITIVE);
        top = stack_pass(top, any_hit);
        link = over ? STACK_END : stack[max(top, 0)];
        top -= 1;
    } while (link != STACK_END);
}
