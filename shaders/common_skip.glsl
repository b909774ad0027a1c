#include "common_leaf.glsl"

// A walk along nodes that lie depth first (Smits 1998): a box that is missed, or a leaf, is followed by what its link
// or its place says, so nothing is kept but where the walk is. The node of zeros, an empty leaf, ends it. Each step goes
// forward.
void skip_walk(uint node, const bool any_hit) {
    uint link = 4u;
    while (link != 0u) {
        bool found = false;
        while (!found) {
            COUNT_NODE(NODE_WORDS);
            vec3 lower, upper;
            float entry;
            fetch_node(node, lower, upper, link);
            bool hit = SKIP_HIT(lower, upper, entry);
            bool leaf = node_axis(link) == LEAF;
            bool over = link == 0u;
            bool down = hit && !leaf;
            bool reached = hit && leaf && !over;
            COUNT_VISIT(down, uint(reached));
            found = reached || over;
            node = down || leaf ? node + 1u : node_skip(link);
        }
        intersect_slots(node_first(link), node_count(link));
        link = any_hit && hit_id != NO_PRIMITIVE ? 0u : link;
    }
}
