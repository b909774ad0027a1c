// One slab test for all rays of a packet that run alike: backward along the same axes and still along none. It is told the
// extremes of their origins and inverse directions. Rounding keeps order, so no ray enters a box before the interval does
// or leaves after it: what the interval misses, all rays miss. Where rays start far apart it enters too much, so after some
// visits each ray is asked again, as it is where rays are not alike.

// What the box test sees of each ray.
#if BOX_CELLS
#define INTERVAL_ABOVE packet_box_above
#define INTERVAL_BELOW packet_box_below
#define INTERVAL_INVERSE packet_box_inverse
#else
#define INTERVAL_INVERSE packet_inverse
#if SLAB_GROWN
#define INTERVAL_ABOVE packet_above
#define INTERVAL_BELOW packet_below
#else
#define INTERVAL_ABOVE packet_slab_origin
#define INTERVAL_BELOW packet_slab_origin
#endif
#endif

const float FARTHEST_FACE = 3.4028235e38;
const int INTERVAL_VISITS = 256;

bool interval_alike;
int interval_left;  // visits until rays count as not alike
bvec3 interval_backward;
vec3 interval_near;   // of the origins from which near faces are seen, that from which they are reached first
vec3 interval_far;    // and of those from which far faces are seen, that from which they are reached last
vec3 interval_least;  // the inverse directions lie between these
vec3 interval_most;

void interval_bound() {
    uint some = 0u;
    uint every = OCTANT_BITS;
    bool still = false;
    vec3 least_near = vec3(FARTHEST_FACE);
    vec3 most_near = vec3(-FARTHEST_FACE);
    vec3 least_far = vec3(FARTHEST_FACE);
    vec3 most_far = vec3(-FARTHEST_FACE);
    interval_least = vec3(FARTHEST_FACE);
    interval_most = vec3(-FARTHEST_FACE);
    for (int k = 0; k < PACKET; k++) {
        if (packet_t[k] >= 0.0) {
            some |= packet_octant[k];
            every &= packet_octant[k];
            still = still || packet_stay[k] != vec3(0.0);
            slab_octant = packet_octant[k];
            vec3 near = mix(INTERVAL_ABOVE[k], INTERVAL_BELOW[k], slab_backward());
            vec3 far = mix(INTERVAL_BELOW[k], INTERVAL_ABOVE[k], slab_backward());
            least_near = min(least_near, near);
            most_near = max(most_near, near);
            least_far = min(least_far, far);
            most_far = max(most_far, far);
            interval_least = min(interval_least, INTERVAL_INVERSE[k]);
            interval_most = max(interval_most, INTERVAL_INVERSE[k]);
        }
    }
    interval_alike = some == every && !still;
    interval_left = INTERVAL_VISITS;
    slab_octant = some;
    interval_backward = slab_backward();
    interval_near = mix(most_near, least_near, interval_backward);
    interval_far = mix(least_far, most_far, interval_backward);
}

bool interval_hit(vec3 lower, vec3 upper, float reach) {
    PRECISE vec3 near = mix(lower, upper, interval_backward) - interval_near;
    PRECISE vec3 far = mix(upper, lower, interval_backward) - interval_far;
    PRECISE vec3 near_a = near * interval_least;
    PRECISE vec3 near_b = near * interval_most;
    PRECISE vec3 far_a = far * interval_least;
    PRECISE vec3 far_b = far * interval_most;
    float entry = slab_first(min(floatBitsToInt(near_a), floatBitsToInt(near_b)));
    ivec3 last = max(floatBitsToInt(far_a), floatBitsToInt(far_b));
    float leave = intBitsToFloat(min(min(last.x, last.y), last.z));
    return entry <= slab_least(leave, reach) * WIDEN;
}

bool interval_enters(vec3 lower, vec3 upper, float reach, uint link) {
    bool hit = interval_alike && interval_hit(lower, upper, reach);
#if INSTRUMENT
    for (int k = 0; k < PACKET; k++) {
        PACKET_VISITED(k, hit && packet_t[k] >= 0.0, link)
    }
#endif
    interval_left -= 1;
    interval_alike = interval_alike && interval_left > 0;
    return hit;
}
