#include "common_leaf.glsl"

// A walk along nodes that lie depth first (Smits 1998): a box that is missed, or a leaf, is followed by what its link
// or its place says, so nothing is kept but where the walk is. The node of zeros, an empty leaf, ends it. Each step goes
// forward. The next node in memory is fetched and tested beside a node: where the walk comes to it, a step goes on from
// there, and what waits for memory is a step. What is used after the inner loop goes round it, and `found` is a number:
// Mesa 22 folds a bool, and lanes that left earlier lose their link.
void skip_walk(uint node, const bool any_hit) {
    uint link = 4u;
    do {
        uint found = 0u;
        do {
            COUNT_NODE(NODE_WORDS);
            COUNT_NODE(NODE_WORDS);
            vec3 lower, upper, next_lower, next_upper;
            float entry, next_entry;
            uint own, next;
            fetch_node(node, lower, upper, own);
            fetch_node(node + 1u, next_lower, next_upper, next);
            bool hit = SKIP_HIT(lower, upper, entry);
            bool next_hit = SKIP_HIT(next_lower, next_upper, next_entry);
            bool leaf = node_axis(own) == LEAF;
            bool next_leaf = node_axis(next) == LEAF;
            bool stops = own == 0u || (hit && leaf);
            bool goes_on = (hit || leaf) && !stops;
            bool next_stops = goes_on && (next == 0u || (next_hit && next_leaf));
            COUNT_VISIT(hit && !leaf, uint(stops && own != 0u));
            COUNT_VISIT(goes_on && next_hit && !next_leaf, uint(next_stops && next != 0u));
            found += uint(stops || next_stops);
            link = stops ? own : (next_stops ? next : link);
            uint after = next_hit || next_leaf ? node + 2u : node_skip(next);
            node = stops ? node + 1u : (goes_on ? after : node_skip(own));
        } while (found == 0u);
        intersect_slots(node_first(link), node_count(link));
        link = any_hit && hit_id != NO_PRIMITIVE ? 0u : link;
    } while (link != 0u);
}
