// The triangles of one leaf.
void intersect_slots(uint first, uint count) {
    uint slot = first;
    while (slot < first + count) {
        COUNT_TRIANGLE(TEST_WORDS);
        intersect(slot);
        slot += 1u;
    }
}
