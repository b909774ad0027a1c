// What the walks of packets have in common: their start, what is counted, and the triangles of a leaf. A fetch counts for one ray of the
// packet, in turn: a ray's share is what it costs.
#if INSTRUMENT
uint packet_turn;

void packet_fetched(uint nodes, uint words) {
    for (int k = 0; k < PACKET; k++) {
        bool own = packet_turn % uint(PACKET) == uint(k);
        packet_counted[k].x += own ? nodes : 0u;
        packet_words[k] += own ? words : 0u;
    }
    packet_turn += 1u;
}

void packet_visited(int k, uint link) {
    packet_counted[k].y += uint(node_axis(link) != LEAF);
    packet_counted[k].z += uint(node_axis(link) == LEAF && node_count(link) > 0u);
}
#define PACKET_FETCHED(nodes, words) packet_fetched(nodes, uint(words))
#define PACKET_VISITED(k, hit, link) if (hit) { packet_visited(k, link); }
#else
#define PACKET_FETCHED(nodes, words)
#define PACKET_VISITED(k, hit, link)
#endif

// Whether the rays come from one eye, made ready for that.
bool packet_set_out(const bool any_hit) {
#if INSTRUMENT
    packet_turn = 0u;
#endif
    bool one_eye = PACKET_EYE != 0 && !any_hit;
    if (one_eye) {
        packet_share();
    }
    return one_eye;
}

// How far the farthest-reaching ray looks.
float packet_reach() {
    float farthest = packet_t[0];
    for (int k = 1; k < PACKET; k++) {
        farthest = max(farthest, packet_t[k]);
    }
    return farthest;
}

// Whether no ray is left that looks for anything.
bool packet_done() {
    return packet_reach() < 0.0;
}

// The triangles of one leaf, tested by every ray.
void packet_intersect_slots(uint first, uint count, const bool any_hit, const bool one_eye) {
    uint slot = first;
    uint last = first + count;
    if (slot < last) {
        do {
            PACKET_FETCHED(0u, TEST_WORDS);
            for (int k = 0; k < PACKET; k++) {
                packet_take(k, one_eye);
                intersect(slot);
                packet_t[k] = any_hit && hit_id != NO_PRIMITIVE ? NEVER : hit_t;
                packet_slot[k] = hit_slot;
                packet_id[k] = hit_id;
#if INSTRUMENT
                packet_counted[k].w += 1u;
#endif
            }
            slot += 1u;
        } while (slot < last);
    }
}
