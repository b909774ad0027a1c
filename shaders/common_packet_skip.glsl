#include "common_packet.glsl"
#include "common_packet_leaf.glsl"

// The walk of `traversal_bvh_skip_octants.glsl` by a packet: rays that run backward along the same axes go together, through
// the nodes in their octant's order, and those of another octant after them. Where any hit will do the order is that of the
// opposite octant: shadow rays begin apart and meet at a light. Rays come to every triangle that a single ray would, so they
// find the same hits.
const uint STEPS = 12u;     // who found no leaf in so many waits while those that others found are tested
const uint STOPPED = 256u;  // more than STEPS
const uint NO_LEAF = 256u;  // the link of a leaf without triangles, which does not end the walk

// Where near faces are seen from, and far ones.
#if BOX_CELLS || SLAB_GROWN
vec3 packet_near[PACKET];
vec3 packet_far[PACKET];
#endif

void packet_face(int k, const bool one_eye) {
    packet_aim(k, one_eye);
#if BOX_CELLS
    packet_near[k] = mix(box_above, box_below, slab_backward());
    packet_far[k] = mix(box_below, box_above, slab_backward());
#elif SLAB_GROWN
    packet_near[k] = mix(slab_above, slab_below, slab_backward());
    packet_far[k] = mix(slab_below, slab_above, slab_backward());
#endif
}

bool packet_enters(vec3 near, vec3 far, uint link, const bool one_eye) {
    bool entered = false;
    for (int k = 0; k < PACKET; k++) {
        packet_aim(k, one_eye);
#if BOX_CELLS
        box_near = packet_near[one_eye ? 0 : k];
        box_far = packet_far[one_eye ? 0 : k];
#elif SLAB_GROWN
        slab_near = packet_near[k];
        slab_far = packet_far[k];
#endif
        float entry;
        bool hit = box_hit_turned(near, far, entry);
        PACKET_VISITED(k, hit, link)
        entered = entered || hit;
    }
    return entered;
}

// As `skip_walk` of `common_skip.glsl`, whose remarks hold here, but that no packet waits longer than STEPS for another's leaf.
void packet_skip_walk(uint node, const bool any_hit, const bool one_eye) {
    uint link = NO_LEAF;
    do {
        uint steps = 0u;
        link = NO_LEAF;
        do {
            PACKET_FETCHED(1u, NODE_WORDS);
            vec3 near, far;
            uint next;
            fetch_node(node, near, far, next);
            bool entered = packet_enters(any_hit ? far : near, any_hit ? near : far, next, one_eye);
            bool leaf = node_axis(next) == LEAF;
            bool stops = leaf && (entered || next == 0u);
            steps += stops ? STOPPED : 1u;
            link = stops ? next : link;
            node = entered || leaf ? node + 1u : node_skip(next);
        } while (steps < STEPS);
        packet_intersect_slots(node_first(link), node_count(link), any_hit, one_eye);
        link = any_hit && packet_done() ? 0u : link;
    } while (link != 0u);
}

void trace(const bool any_hit) {
    bool one_eye = packet_set_out(any_hit);
    uint waiting = 0u;  // a bit a ray
    for (int k = 0; k < PACKET; k++) {
        waiting |= packet_t[k] >= 0.0 ? 1u << k : 0u;
    }
    float held[PACKET];
    while (waiting != 0u) {
        for (int k = PACKET - 1; k >= 0; k--) {
            packet_way = (waiting & (1u << k)) != 0u ? packet_octant[k] : packet_way;
        }
        for (int k = 0; k < PACKET; k++) {
            bool walks = packet_octant[k] == packet_way;
            waiting &= ~(walks ? 1u << k : 0u);
            held[k] = packet_t[k];
            packet_t[k] = walks ? packet_t[k] : NEVER;
            packet_face(k, one_eye);
        }
        packet_skip_walk(node_copy((any_hit ? packet_way ^ OCTANT_BITS : packet_way) >> 1), any_hit, one_eye);
        for (int k = 0; k < PACKET; k++) {
            packet_t[k] = packet_octant[k] == packet_way ? packet_t[k] : held[k];
        }
    }
}
