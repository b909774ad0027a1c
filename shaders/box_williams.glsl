// Williams, Barrus, Morley and Shirley 2005: bounds picked by the sign of 1/d, three comparisons in turn. As
// published: 0 * inf and -0.0 go where IEEE sends them, and nothing is widened.
vec3 williams_inverse;
bvec3 williams_sign;

void box_prepare() {
    williams_inverse = 1.0 / ray_direction;
    williams_sign = lessThan(williams_inverse, vec3(0.0));
}

bool box_hit(vec3 lower, vec3 upper, out float entry) {
    PRECISE vec3 first = (mix(lower, upper, williams_sign) - ray_origin) * williams_inverse;
    PRECISE vec3 last = (mix(upper, lower, williams_sign) - ray_origin) * williams_inverse;
    float enter = first.x;
    float leave = last.x;
    PRECISE bool missed = enter > last.y || first.y > leave;
    enter = first.y > enter ? first.y : enter;
    leave = last.y < leave ? last.y : leave;
    missed = missed || enter > last.z || first.z > leave;
    enter = first.z > enter ? first.z : enter;
    leave = last.z < leave ? last.z : leave;
    entry = max(enter, 0.0);
    return !missed && enter < hit_t && leave > 0.0;
}

bool box_hit_turned(vec3 near, vec3 far, out float entry) {
    return box_hit(mix(near, far, slab_backward()), mix(far, near, slab_backward()), entry);
}
