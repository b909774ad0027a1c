// What the KD traversals share. Cells are told apart by the t at which the ray crosses a plane, computed everywhere
// by this one expression: a plane crossed at or before t0 lies behind, so t0 grows strictly from leaf to leaf.
uniform vec3 root_lower;
uniform vec3 root_upper;

float plane_t(uint axis, float plane) {
    float from = axis == 1u ? slab_origin.x : axis == 2u ? slab_origin.y : slab_origin.z;
    float inverse = axis == 1u ? slab_inverse.x : axis == 2u ? slab_inverse.y : slab_inverse.z;
    PRECISE float t = (plane - from) * inverse;
    return t;
}

// Whether a walk that reached t0 and goes on at t1 gets on. As integers, or a NaN (planes beyond 2^126 away make them)
// would let it walk for ever; so each leaf ends at another plane, and a walk visits at most inner nodes + 1 of them.
bool gets_on(float t0, float t1) {
    bool on = floatBitsToInt(t1) > floatBitsToInt(t0);
    trace_stuck = trace_stuck || !on;
    return on;
}

// Where the ray leaves a cell: the same numbers as `plane_t`, so never grown.
float cell_exit(vec3 lower, vec3 upper) {
    return slab_last(max(slab_t(lower), slab_t(upper)));
}

void intersect_refs(uint first, uint count) {
    uint i = 0u;
    while (i < count) {
        COUNT_WORDS(1);
        COUNT_TRIANGLE(TEST_WORDS);
        intersect(node_ref(first + i));
        i += 1u;
    }
}
