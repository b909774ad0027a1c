#include "common_kd.glsl"

// Foley and Sugerman 2005: after a leaf, climb to the first ancestor whose box the ray has not left, and descend from
// there. Children are told apart by where t0 lies, with no near and far (paper section 7.1).
void trace(const bool any_hit) {
    float t0;
    bool done = !box_hit(root_lower, root_upper, t0);
    float scene_exit = cell_exit(root_lower, root_upper);
    float t1 = scene_exit;
    uint node = 0u;
    while (!done) {
        COUNT_NODE(2);
        uvec2 words = node_chunk(node, 0u).xy;
        uint axis = node_axis(words);
        while (axis != LEAF) {
            COUNT_INNER;
            float t = plane_t(axis, node_split(words));
            bool behind = t <= t0;
            uint backward = (slab_octant >> axis) & 1u;
            node = node_child(words) + (uint(behind) ^ backward);
            t1 = behind ? t1 : min(t1, t);
            COUNT_NODE(2);
            words = node_chunk(node, 0u).xy;
            axis = node_axis(words);
        }
        COUNT_LEAF;
        intersect_refs(node_first(words), node_count(words));
        done = hit_t < t1 || t1 >= scene_exit || (any_hit && hit_id != NO_PRIMITIVE);
        done = done || !gets_on(t0, t1);
        t0 = t1;
        COUNT_WORDS(1);
        uint up = node_parent(uvec4(node_links(node)));
        while (!done && t1 <= t0) {
            node = up;
            COUNT_NODE(7);
            uvec4 low = node_chunk(node, 1u);
            up = node_parent(low);
            t1 = cell_exit(node_lower(low), node_upper(node_chunk(node, 2u)));
            done = node == 0u && t1 <= t0;
        }
    }
}
