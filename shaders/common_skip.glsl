#include "common_leaf.glsl"

// A walk along nodes that lie depth first (Smits 1998): a box that is missed, or a leaf, is followed by what its link
// or its place says, so nothing is kept but where the walk is. The node of zeros, an empty leaf, ends it. Each step goes
// forward. What is used after the inner loop goes round it, and `found` is a number: Mesa 22 folds a bool, and lanes that
// left earlier lose their link.
void skip_walk(uint node, const bool any_hit) {
    uint link = 4u;
    do {
        uint found = 0u;
        do {
            COUNT_NODE(NODE_WORDS);
            vec3 lower, upper;
            float entry;
            uint next;
            fetch_node(node, lower, upper, next);
            bool hit = SKIP_HIT(lower, upper, entry);
            bool leaf = node_axis(next) == LEAF;
            bool over = next == 0u;
            bool down = hit && !leaf;
            bool reached = hit && leaf && !over;
            COUNT_VISIT(down, uint(reached));
            found += uint(reached || over);
            link = found > 0u ? next : link;
            node = down || leaf ? node + 1u : node_skip(next);
        } while (found == 0u);
        intersect_slots(node_first(link), node_count(link));
        link = any_hit && hit_id != NO_PRIMITIVE ? 0u : link;
    } while (link != 0u);
}
