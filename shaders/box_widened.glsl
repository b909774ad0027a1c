// Conservative box test: skips a box only if its entry lies behind its widened exit or behind the closest hit.
void box_prepare() {
}

bool box_hit(vec3 lower, vec3 upper, out float entry) {
    entry = slab_entry(lower, upper);
    return entry <= slab_least(slab_exit(lower, upper), hit_t) * WIDEN;
}

// The same, told which faces are the near ones.
bool box_hit_turned(vec3 near, vec3 far, out float entry) {
    entry = slab_first(slab_near_t(near));
    return entry <= slab_least(slab_last(slab_far_t(far)), hit_t) * WIDEN;
}
