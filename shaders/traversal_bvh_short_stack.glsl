#include "common_enter.glsl"
#include "common_leaf.glsl"
#include "common_trail.glsl"

// Laine 2010: a restart trail, and a short stack of far children that spares most restarts (Vaidyanathan et al. 2019). A
// push beyond its size forgets the oldest, which a restart from the root then finds. The lowest level that the trail has
// left is that of the stack's last entry. The stack is written whether a child is pushed or not, so one entry is never held.
void trace(const bool any_hit) {
    uint root;
    bool done = !enters_root(root);

    trail_clear();
    uint stack[SHORT_STACK];
    uint top = 0u;   // pushes less pops
    uint held = 0u;  // of these, how many the stack still has
    int pop_level = -1;
    uint link = root;
    int level = TRAIL_TOP;
    while (!done) {
        bool popping = false;
        bool walking = node_axis(link) != LEAF;
        while (walking) {
            uint child = node_child(link);
            uint left, right;
            float left_entry, right_entry;
            bool left_hit = enters(child, left_entry, left);
            bool right_hit = enters(child + 1u, right_entry, right);
            bool both = left_hit && right_hit;
            bool second = trail_test(level);
            bool go_right = both ? (right_entry < left_entry) != second : right_hit;
            // One child left at the level just restarted for is the near one, already done.
            popping = !(left_hit || right_hit) || (!both && level == pop_level);
            bool push = both && !second;
            stack[top & uint(SHORT_STACK - 1)] = go_right ? left : right;
            top += uint(push);
            held = min(held + uint(push), uint(SHORT_STACK - 1));
            trail_set(level, !both);
            link = go_right ? right : left;
            level -= 1;
            COUNT_VISIT(true, 0u);
            walking = !popping && node_axis(link) != LEAF;
        }
        uint count = popping ? 0u : node_count(link);
        COUNT_VISIT(false, count);
        intersect_slots(node_first(link), count);
        // `level` is one below the level whose choice was just finished.
        pop_level = trail_pop(min(level + 1, TRAIL_TOP));
        done = trail_over() || node_axis(root) == LEAF || (any_hit && hit_id != NO_PRIMITIVE);
        bool pop = held > 0u;
        top -= uint(pop);
        held -= uint(pop);
        uint popped = stack[top & uint(SHORT_STACK - 1)];
        link = pop ? popped : root;
        level = pop ? pop_level - 1 : TRAIL_TOP;
    }
}
