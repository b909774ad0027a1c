#include "common_packet.glsl"
#include "common_packet_leaf.glsl"
#include "common_stack.glsl"

// The stack traversal (`traversal_bvh_stack.glsl`) of a packet: a node is entered if any ray enters its box, the first
// ray's near child goes first, and a leaf's triangles are tested by every ray. Where any hit will do its far child does:
// shadow rays begin apart and meet at a light. Rays see every box that a single ray would, so they find the same hits.
#if PACKET_INTERVAL
#include "common_packet_interval.glsl"
#endif

bool packet_enters(uint node, const bool one_eye, out uint link) {
    PACKET_FETCHED(1u, NODE_WORDS);
    vec3 lower, upper;
    fetch_node(node, lower, upper, link);
    bool entered = false;
#if PACKET_INTERVAL
    entered = interval_enters(lower, upper, packet_reach(), link);
    // A loop of one turn: where lanes run in masks, what stands behind an `if` is always run.
    bool apart = !interval_alike;
    while (apart) {
        apart = false;
#endif
        for (int k = 0; k < PACKET; k++) {
            packet_aim(k, one_eye);
            float entry;
            bool hit = box_hit(lower, upper, entry);
            PACKET_VISITED(k, hit, link)
            entered = entered || hit;
        }
#if PACKET_INTERVAL
    }
#endif
    return entered;
}

void trace(const bool any_hit) {
#if PACKET_INTERVAL
    interval_bound();
#endif
    bool one_eye = packet_set_out(any_hit);
    uint order = any_hit ? packet_octant[0] ^ OCTANT_BITS : packet_octant[0];
    uint root;
    bool entered = packet_enters(0u, one_eye, root);
    uint stack[STACK_SIZE + 2];
    stack[0] = STACK_END;
    int top = 0;
    uint link = entered ? root : STACK_END;
    do {
        if (node_axis(link) != LEAF) {
            do {
                uint child = node_child(link) + ((order >> node_axis(link)) & 1u);
                uint near, far;
                bool near_hit = packet_enters(child, one_eye, near);
                bool far_hit = packet_enters(child ^ 1u, one_eye, far);
                uint popped = stack[top];
                stack[top + 1] = far;
                link = near_hit ? near : far_hit ? far : popped;
                top += int(near_hit) + int(far_hit) - 1;
            } while (node_axis(link) != LEAF);
        }
        uint count = link == STACK_END ? 0u : node_count(link);
        packet_intersect_slots(node_first(link), count, any_hit, one_eye);
        bool over = link == STACK_END || (any_hit && packet_done());
        link = over ? STACK_END : stack[max(top, 0)];
        top -= 1;
    } while (link != STACK_END);
}
