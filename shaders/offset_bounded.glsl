// A shadow ray starts as near to its triangle as float32 arithmetic is sure to be on the eye's side of it. Bounds are
// gamma(n) = n eps / (1 - n eps), eps = 2^-24, on terms that pass n roundings (Pharr, Jakob, Humphreys, section 6.8), and
// 1 % more for what they round themselves. Let N be the exact normal b x c of two edges b, c at the corner `base`.
//
// The point. Any u, v name a point p* = base + u b + v c of the triangle's plane: what the t of a long ray is off moves
// it along the plane, not out of it, and clamped it is inside the triangle, so on the same side of what bounds that.
// Computed, with the last sum that lifts it off the plane, base passes 3 roundings, u b 5 and v c 4: the origin is
// within F = gamma(5) (|u b| + |v c|) + gamma(3) |base| of p* plus the lift, in each component.
//
// The normal. Computed it is n with |n - N| <= G, G = gamma(5) (|b_y c_z| + |b_z c_y|) and so on. At the corner before
// the longest edge the angle is the widest: G is then small beside |N|, unless the triangle is a line to float32.
//
// Lifted by k n, the origin is k N . n - |N| . F >= k (|n|^2 - G . |n|) - (|n| + G) . F above the plane, in units of |N|.
// That must pass `offset_room`, so that this intersector too finds the triangle behind: solve for k. And the point keeps
// as far from the edges, so that the planes of neighbours do not come nearer than this one.
// Precise, so that every program finds the same bits.
const float EPS = 5.9604645e-8;
const float SURE = 1.01;
const float OFFSET_LEAST = 1.0e-30;  // more than underflow takes, and eps of it is no subnormal number

vec3 offset_base;
vec3 offset_b;
vec3 offset_c;

void offset_edges() {
    PRECISE vec3 ab = surface_b - surface_a;
    PRECISE vec3 bc = surface_c - surface_b;
    PRECISE vec3 ca = surface_a - surface_c;
    PRECISE vec3 squares = vec3(dot(bc, bc), dot(ca, ca), dot(ab, ab));
    bool at_a = squares.x >= max(squares.y, squares.z);
    bool at_b = !at_a && squares.y >= squares.z;
    offset_base = at_a ? surface_a : at_b ? surface_b : surface_c;
    offset_b = at_a ? ab : at_b ? bc : ca;
    offset_c = at_a ? -ca : at_b ? -ab : -bc;
}

vec3 offset_point(vec2 at) {
    PRECISE vec3 point = offset_base + at.x * offset_b + at.y * offset_c;
    return point;
}

// k times what it is divided by. `sure` is |n| + G; `room` turns the room's unit into that of n.
float offset_lift(vec2 at, vec3 lifted, vec3 sure, float room) {
    PRECISE vec3 off = 3.0 * abs(offset_base) + 5.0 * (at.x * abs(offset_b) + at.y * abs(offset_c));
    PRECISE float lift = SURE * EPS * (dot(sure, off) + room * offset_room(lifted)) + OFFSET_LEAST;
    return lift;
}

vec3 offset_origin() {
    offset_edges();
    PRECISE vec3 normal = cross(offset_b, offset_c);
    PRECISE vec3 size = abs(normal);
    PRECISE float scale = 1.0 / max(max(size.x, size.y), max(size.z, 1.0e-37));
    PRECISE vec3 n = normal * (dot(normal, ray_direction) > 0.0 ? -scale : scale);
    PRECISE vec3 terms = abs(offset_b.yzx * offset_c.zxy) + abs(offset_b.zxy * offset_c.yzx);
    PRECISE vec3 unsure = 5.0 * SURE * EPS * scale * terms;
    PRECISE float square = dot(n, n);
    PRECISE float each = 1.0 / max(square - dot(unsure, abs(n)), 0.25 * square);
    PRECISE vec3 sure = abs(n) + unsure;

    PRECISE vec3 reached = surface_point - offset_base;
    PRECISE float area = 1.0 / dot(normal, n);
    PRECISE float u = clamp(dot(cross(reached, offset_c), n) * area, 0.0, 1.0);
    PRECISE float v = clamp(dot(cross(offset_b, reached), n) * area, 0.0, 1.0 - u);
    PRECISE float by = each * offset_lift(vec2(u, v), offset_point(vec2(u, v)), sure, scale);

    PRECISE float rim = min(by * scale * length(offset_b - offset_c), 0.33);
    u = clamp(u, rim, 1.0 - 2.0 * rim);
    v = clamp(v, rim, 1.0 - rim - u);
    vec3 point = offset_point(vec2(u, v));
    PRECISE vec3 lifted = point + by * n;
    by = each * offset_lift(vec2(u, v), lifted, sure, scale);
    PRECISE vec3 origin = point + by * n;
    return origin;
}
