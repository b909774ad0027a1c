// One ray of a buffer instead of a camera's (`renderer/ray_plan.py`): its closest hit, or any hit. A spawned ray starts
// at a hit of the ray that is given with it, where the variant's offset has a shadow ray start.
#include "common_budget.glsl"
#include "common_begin.glsl"

uniform uint ray_count;

// origin, reach; direction, what is asked (bit 0: any hit, bit 1: spawned); t, slot and id of the hit that it starts at;
// direction and reach of the spawned ray.
layout(std430, binding = 5) readonly restrict buffer GivenRays { uvec4 given_rays[]; };

vec4 render_pixel(ivec2 pixel) {
    uint i = uint(pixel.y * image_size.x + pixel.x);
    if (i >= ray_count) {
        return vec4(0.0, 0.0, 0.0, 1.0);
    }
    uvec4 start = given_rays[4u * i];
    uvec4 way = given_rays[4u * i + 1u];
    begin_ray(uintBitsToFloat(start.xyz), uintBitsToFloat(way.xyz), uintBitsToFloat(start.w));
    if ((way.w & 2u) != 0u) {
        uvec4 found = given_rays[4u * i + 2u];
        uvec4 next = given_rays[4u * i + 3u];
        hit_t = uintBitsToFloat(found.x);
        hit_slot = found.y;
        hit_id = found.z;
        surface_from_hit();
        begin_ray(offset_origin(), uintBitsToFloat(next.xyz), uintBitsToFloat(next.w));
    }
    trace(ANY_HIT);
    bool cut = trace_stuck || budget_spent();
#if INSTRUMENT
    uint at = record_base(pixel);
    record_ray(at, hit_t, hit_id);
    record_cut(at, cut);
    records[at + 3u].z = hit_slot;
#endif
    return vec4(hit_id != NO_PRIMITIVE ? 1.0 / (1.0 + hit_t) : 0.0, 0.0, 0.0, cut ? 0.0 : 1.0);
}
