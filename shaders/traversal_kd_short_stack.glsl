#include "common_kd.glsl"

// Horn et al. 2007: push-down, and a short stack of far cells that spares most restarts. A push beyond its size forgets
// the oldest cell, and a pop of nothing restarts from the lowest node that holds all of what is left of the ray. The
// stack is written whether a cell is pushed or not, so one entry is never held.
void trace(const bool any_hit) {
    float t0;
    bool done = !box_hit(root_lower, root_upper, t0);
    float scene_exit = cell_exit(root_lower, root_upper);
    uvec2 stack[SHORT_STACK];  // a far child and the bits of the t at which its cell ends
    uint top = 0u;    // pushes less pops
    uint held = 0u;   // of these, how many the stack still has
    uint start = 0u;
    uint node = 0u;
    float t1 = scene_exit;
    bool whole = true;
    while (!done) {
        COUNT_NODE(2);
        uvec2 words = node_chunk(node, 0u);
        uint axis = node_axis(words);
        while (axis != LEAF) {
            COUNT_INNER;
            float t = plane_t(axis, node_split(words));
            bool behind = t <= t0;
            bool ahead = !behind && t >= t1;
            bool both = !behind && !ahead;
            uint backward = (slab_octant >> axis) & 1u;
            uint near = node_child(words) + backward;
            node = behind ? near ^ 1u : near;
            stack[top & uint(SHORT_STACK - 1)] = uvec2(near ^ 1u, floatBitsToUint(t1));
            top += uint(both);
            held = min(held + uint(both), uint(SHORT_STACK - 1));
            t1 = both ? t : t1;
            whole = whole && !both;
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
        bool pop = held > 0u;
        top -= uint(pop);
        held -= uint(pop);
        uvec2 popped = stack[top & uint(SHORT_STACK - 1)];
        node = pop ? popped.x : start;
        t1 = pop ? uintBitsToFloat(popped.y) : scene_exit;
        whole = !pop;
    }
}
