// Moller and Trumbore 1997, two-sided. What it accepts must also lie in the triangle's own box as the slab test sees
// it, and t is clamped there: the box is a tighter bound on t than this test's rounding error, and since boxes that
// contain it enter no later and leave no earlier, no traversal can then skip the hit.
const int TEST_WORDS = TRIANGLE_WORDS;

void intersector_prepare() {
}

void intersect(uint slot) {
    vec3 a, b, c;
    uint id;
    fetch_triangle(slot, a, b, c, id);
    PRECISE vec3 ab = b - a;
    PRECISE vec3 ac = c - a;
    PRECISE vec3 p = cross(ray_direction, ac);
    PRECISE float inverse = 1.0 / dot(ab, p);
    // The same bits as with s = o - a, and the slab test's difference as well: a sign is no rounding, and GPUs negate
    // for nothing.
    PRECISE vec3 away = a - slab_origin;
    PRECISE float u = dot(away, p) * -inverse;
    PRECISE vec3 q = cross(ab, away);
    PRECISE float v = dot(ray_direction, q) * inverse;
    PRECISE float t = dot(ac, q) * inverse;

    float entry, leave;
    slab_cross(a, b, c, away, entry, leave);
    bool inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && entry <= leave;
    take_hit(inside, clamp(t, entry, leave), slot, id);
}
