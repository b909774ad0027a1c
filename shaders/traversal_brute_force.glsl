// Every triangle of [range_first, range_last); the plan cuts a large scene into passes.
uniform uint range_first;
uniform uint range_last;

void trace(const bool any_hit) {
    uint slot = range_first;
    bool done = slot >= range_last;
    while (!done) {
        COUNT_TRIANGLE(TEST_WORDS);
        intersect(slot);
        slot += 1u;
        done = slot >= range_last || (any_hit && hit_id != NO_PRIMITIVE);
    }
}
