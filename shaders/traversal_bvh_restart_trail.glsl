#include "common_leaf.glsl"
#include "common_trail.glsl"

// Laine 2010, without a short stack: both children are tested at their parent, the nearer goes first, and a restart
// from the root follows the trail. A set bit means that nothing but the last child of that level is left.
void trace(const bool any_hit) {
    COUNT_NODE(7);
    uvec4 root = node_chunk(0u, 0u);
    float entry;
    bool done = !box_hit(node_lower(root), node_upper(node_chunk(0u, 1u)), entry);

    trail_clear();
    int pop_level = -1;
    while (!done) {
        uint link = root.w;
        int level = TRAIL_TOP;
        bool popping = false;
        bool walking = node_axis(root) != LEAF;
        while (walking) {
            COUNT_NODE(7);
            COUNT_NODE(7);
            uint child = node_child(uvec4(link));
            uvec4 left = node_chunk(child, 0u);
            uvec4 right = node_chunk(child + 1u, 0u);
            float left_entry, right_entry;
            bool left_hit = box_hit(node_lower(left), node_upper(node_chunk(child, 1u)), left_entry);
            bool right_hit = box_hit(node_lower(right), node_upper(node_chunk(child + 1u, 1u)), right_entry);
            bool both = left_hit && right_hit;
            bool go_right = both ? (right_entry < left_entry) != trail_test(level) : right_hit;
            // One child left at the level just popped to is the near one, already done.
            popping = !(left_hit || right_hit) || (!both && level == pop_level);
            trail_set(level, !both);
            link = go_right ? right.w : left.w;
            level -= 1;
            COUNT_VISIT(true, 0u);
            walking = !popping && node_axis(uvec4(link)) != LEAF;
        }
        uvec4 leaf = uvec4(link);
        uint count = popping ? 0u : node_count(leaf);
        COUNT_VISIT(false, count);
        intersect_slots(node_first(leaf), count);
        // `level` is one below the level whose choice was just finished.
        pop_level = trail_pop(min(level + 1, TRAIL_TOP));
        done = trail_over() || node_axis(root) == LEAF || (any_hit && hit_id != NO_PRIMITIVE);
    }
}
