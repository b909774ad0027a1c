// The triangles of one leaf; `cut` tells if the loop was stopped early.
void intersect_slots(uint first, uint count) {
    uint slot = first;
    while (slot < first + count) {
        COUNT_TRIANGLE(TRIANGLE_WORDS);
        intersect(slot);
        slot += 1u;
    }
    cut = cut || slot != first + count;
}
