#include "common_enter.glsl"
#include "common_leaf.glsl"
#include "common_trail.glsl"

// Laine 2010, without a short stack: both children are tested at their parent, the nearer goes first, and a restart
// from the root follows the trail. A set bit means that nothing but the last child of that level is left.
void trace(const bool any_hit) {
    uint root;
    bool done = !enters_root(root);

    trail_clear();
    int pop_level = -1;
    while (!done) {
        uint link = root;
        int level = TRAIL_TOP;
        bool popping = false;
        bool walking = node_axis(root) != LEAF;
        while (walking) {
            uint child = node_child(link);
            uint left, right;
            float left_entry, right_entry;
            bool left_hit = enters(child, left_entry, left);
            bool right_hit = enters(child + 1u, right_entry, right);
            bool both = left_hit && right_hit;
            bool go_right = both ? (right_entry < left_entry) != trail_test(level) : right_hit;
            // One child left at the level just popped to is the near one, already done.
            popping = !(left_hit || right_hit) || (!both && level == pop_level);
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
    }
}
