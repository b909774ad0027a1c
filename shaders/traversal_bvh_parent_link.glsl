#include "common_leaf.glsl"

// Hapala et al. 2011: stackless, in the order of the stack traversal. A node knows its parent and its parent's split
// axis, so that whether it is the near child, and where to go next, takes one word on the way up.
bool is_near(uint node, uint links) {
    return (node & 1u) == ((slab_octant >> node_parent_axis(links)) & 1u);
}

void trace(const bool any_hit) {
    uint node = 0u;
    bool done = false;
    while (!done) {
        uint first = 0u;
        uint count = 0u;
        while (!done && count == 0u) {
            COUNT_NODE(NODE_WORDS);
            vec3 lower, upper;
            uint link, links;
            fetch_node(node, lower, upper, link, links);
            float entry;
            bool hit = box_hit(lower, upper, entry);
            uint axis = node_axis(link);
            bool down = hit && axis != LEAF;
            uint near = node_child(link) + ((slab_octant >> axis) & 1u);
            first = node_first(link);
            count = hit && axis == LEAF ? node_count(link) : 0u;
            COUNT_VISIT(down, count);
            // Up to the first near child on the way to the root: its sibling is next.
            bool up = !down && node != 0u && !is_near(node, links);
            while (up) {
                node = node_parent(links);
                COUNT_NODE(1);
                links = node_links(node);
                up = node != 0u && !is_near(node, links);
            }
            done = !down && node == 0u;
            node = down ? near : node ^ 1u;
        }
        intersect_slots(first, count);
        done = done || (any_hit && hit_id != NO_PRIMITIVE);
    }
}
