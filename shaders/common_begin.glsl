// How a ray begins. One with a NaN or an infinity in origin or direction, with a NaN as its reach, or without direction
// hits nothing, and costs one box: its reach becomes minus infinity, before which no box is entered and nothing is hit.
// Bits are compared, as compilers may take it that there is no NaN.
const uint INFINITE = 0x7f800000u;
const uint MAGNITUDE = 0x7fffffffu;

bool ray_exists(vec3 origin, vec3 direction, float reach) {
    uvec3 from = floatBitsToUint(origin) & MAGNITUDE;
    uvec3 along = floatBitsToUint(direction) & MAGNITUDE;
    bool finite = max(max(from.x, from.y), max(from.z, max(along.x, max(along.y, along.z)))) < INFINITE;
    return finite && (along.x | along.y | along.z) != 0u && (floatBitsToUint(reach) & MAGNITUDE) <= INFINITE;
}

void begin_ray(vec3 origin, vec3 direction, float reach) {
    ray_origin = origin;
    ray_direction = direction;
    hit_t = ray_exists(origin, direction, reach) ? reach : uintBitsToFloat(0xff800000u);
    hit_slot = 0u;
    hit_id = NO_PRIMITIVE;
#if INSTRUMENT
    counted = uvec4(0u);
    counted_words = 0u;
#endif
    slab_prepare();
    intersector_prepare();
    box_prepare();
}
