// The triangles of one leaf.
void intersect_slots(uint first, uint count) {
    uint slot = first;
    if (count > 0u) {
        do {
            COUNT_TRIANGLE(TEST_WORDS);
            intersect(slot);
            slot += 1u;
        } while (slot < first + count);
    }
}
