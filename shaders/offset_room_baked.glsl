// How far above a triangle's plane, in units of the exact normal's length and of eps, an origin over `point` must lie for
// the test to find t < 0: its height along the kept axis is x + h_x y + h_y z + h_z with |h_x|, |h_y| <= 1. The products
// pass 5 roundings at most, their own included, and h_z, which is at most |x| + |y| + |z|, 4.
float offset_room(vec3 point) {
    PRECISE vec3 normal = abs(cross(surface_b - surface_a, surface_c - surface_a));
    PRECISE float room = 9.0 * max(normal.x, max(normal.y, normal.z)) * (abs(point.x) + abs(point.y) + abs(point.z));
    return room;
}
