// As `render_rays.glsl`, with the rays of a block traced together; all of them are asked the same.
#include "common_budget.glsl"

uniform uint ray_count;
layout(std430, binding = 5) readonly restrict buffer GivenRays { uvec4 given_rays[]; };

void packet_begin(uint i, int k) {
    bool given = i < ray_count;
    uint at = 4u * (given ? i : 0u);
    uvec4 start = given_rays[at];
    uvec4 way = given_rays[at + 1u];
    begin_ray(uintBitsToFloat(start.xyz), uintBitsToFloat(way.xyz), uintBitsToFloat(start.w));
    if ((way.w & 2u) != 0u) {
        uvec4 found = given_rays[at + 2u];
        uvec4 next = given_rays[at + 3u];
        hit_t = uintBitsToFloat(found.x);
        hit_slot = found.y;
        hit_id = found.z;
        surface_from_hit();
        begin_ray(offset_origin(), uintBitsToFloat(next.xyz), uintBitsToFloat(next.w));
    }
    packet_keep(k, given);
}

void render_packet(ivec2 corner) {
    for (int k = 0; k < PACKET; k++) {
        ivec2 pixel = packet_pixel(corner, k);
        packet_begin(uint(pixel.y * image_size.x + pixel.x), k);
    }
    uvec4 way = given_rays[1];
    trace(ANY_HIT);
    bool cut = trace_stuck || budget_spent();
    for (int k = 0; k < PACKET; k++) {
        packet_shown[k] = vec4(packet_id[k] != NO_PRIMITIVE ? 1.0 : 0.0, 0.0, 0.0, cut ? 0.0 : 1.0);
#if INSTRUMENT
        ivec2 pixel = packet_pixel(corner, k);
        if (uint(pixel.y * image_size.x + pixel.x) < ray_count) {
            packet_take(k, false);
            uint at = record_base(pixel);
            record_ray(at, hit_t, hit_id);
            record_cut(at, cut);
            records[at + 3u].z = hit_slot;
        }
#endif
    }
}
