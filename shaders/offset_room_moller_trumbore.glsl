// How far above a triangle's plane, in units of the exact normal's length and of eps, an origin over `point` must lie for
// the test to find t < 0: the error of N . s, s = o - a, is gamma(7) of its terms' magnitudes (`renderer/judge/referee/bound.py`).
float offset_room(vec3 point) {
    PRECISE vec3 ab = abs(surface_b - surface_a);
    PRECISE vec3 ac = abs(surface_c - surface_a);
    PRECISE float room = 7.0 * dot(abs(point - surface_a), ab.yzx * ac.zxy + ab.zxy * ac.yzx);
    return room;
}
