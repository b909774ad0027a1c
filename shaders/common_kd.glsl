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

void intersect_refs(uint first, uint count) {
    uint i = 0u;
    while (i < count) {
        COUNT_WORDS(1);
        COUNT_TRIANGLE(TRIANGLE_WORDS);
        intersect(node_ref(first + i));
        i += 1u;
    }
}
