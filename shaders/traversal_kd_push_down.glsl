#include "common_kd.glsl"

// Horn et al. 2007: restart, but from the lowest node that holds all of what is left of the ray.
void trace(const bool any_hit) {
    float t0;
    bool done = !box_hit(root_lower, root_upper, t0);
    float scene_exit = cell_exit(root_lower, root_upper);
    uint start = 0u;
    while (!done) {
        uint node = start;
        float t1 = scene_exit;
        bool whole = true;
        COUNT_NODE(2);
        uvec2 words = node_chunk(node, 0u);
        uint axis = node_axis(words);
        while (axis != LEAF) {
            COUNT_INNER;
            float t = plane_t(axis, node_split(words));
            bool behind = t <= t0;
            bool ahead = !behind && t >= t1;
            uint backward = (slab_octant >> axis) & 1u;
            node = node_child(words) + (behind ? 1u - backward : backward);
            whole = whole && (behind || ahead);
            t1 = behind || ahead ? t1 : t;
            start = whole ? node : start;
            COUNT_NODE(2);
            words = node_chunk(node, 0u);
            axis = node_axis(words);
        }
        COUNT_LEAF;
        intersect_refs(node_first(words), node_count(words));
        // Equal t may hide a smaller id in the next leaf, hence the strict test.
        done = hit_t < t1 || t1 >= scene_exit || (any_hit && hit_id != NO_PRIMITIVE);
        done = done || !gets_on(t0, t1);
        t0 = t1;
    }
}
