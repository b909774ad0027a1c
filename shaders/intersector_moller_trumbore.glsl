// Moller and Trumbore 1997, two-sided. What it accepts must also lie in the triangle's own box as the slab test sees
// it, and t is clamped there: the box is a tighter bound on t than this test's rounding error, and since boxes that
// contain it enter no later and leave no earlier, no traversal can then skip the hit.
void intersect(uint slot) {
    vec3 a, b, c;
    uint id;
    fetch_triangle(slot, a, b, c, id);
    PRECISE vec3 ab = b - a;
    PRECISE vec3 ac = c - a;
    PRECISE vec3 p = cross(ray_direction, ac);
    PRECISE float inverse = 1.0 / dot(ab, p);
    PRECISE vec3 s = ray_origin - a;
    PRECISE float u = dot(s, p) * inverse;
    PRECISE vec3 q = cross(s, ab);
    PRECISE float v = dot(ray_direction, q) * inverse;
    PRECISE float t = dot(ac, q) * inverse;

    vec3 lower = min(a, min(b, c));
    vec3 upper = max(a, max(b, c));
    float entry = slab_entry(lower, upper);
    PRECISE float leave = slab_exit(lower, upper) * WIDEN;
    bool inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && entry <= leave;
    t = clamp(t, entry, leave);
    // The closest hit is the smallest t, then the smallest id (DESIGN.md, Accuracy).
    if (inside && (t < hit_t || (t == hit_t && id < hit_id))) {
        hit_t = t;
        hit_slot = slot;
        hit_id = id;
    }
}
