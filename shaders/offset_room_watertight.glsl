// How far above a triangle's plane, in units of the exact normal's length and of eps, an origin over `point` must lie for
// the test to find t < 0. It finds N . s as U A_z + V B_z + W C_z, U = C_x B_y - C_y B_x and so on, where A, B, C are the
// corners seen from the origin, and x, y are sheared by at most 1 each: (x, y) is at most sqrt(3) as long as its corner,
// so the three terms come to at most 9 |A| |B| |C|. The corners pass 1 rounding each, and then x and y 2, U 2, and the
// sum 3, which is 3 + 9 for each product; what the slope is rounded to is all the same, as shearing changes no volume.
float offset_room(vec3 point) {
    PRECISE vec3 sizes = vec3(length(surface_a - point), length(surface_b - point), length(surface_c - point));
    PRECISE float room = 9.0 * 12.0 * sizes.x * sizes.y * sizes.z;
    return room;
}
