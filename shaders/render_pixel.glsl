// One pixel, Whitted's way (paper section 3.1): a primary ray, then a shadow ray to each light from every hit, none
// skipped for facing away. STAGE_PRIMARY and STAGE_SHADOW say which rays this pass traces; STATE_HITS, STATE_HIDDEN and
// STATE_OUT say what of the rest it takes from and leaves to other passes. Without SHADE, where primary rays alone are
// timed, nothing of the surface is fetched and the picture shows distances.
#include "common_budget.glsl"
#include "common_begin.glsl"

uniform vec3 lights[LIGHTS];
uniform float scene_size;  // the diagonal of the bounds

#if STATE_HITS || STATE_HIDDEN || STATE_OUT
layout(std430, binding = 3) restrict buffer State { uvec4 state[]; };  // t, slot, id, bit l: light l is hidden; bit 31: cut
#endif

const float FARTHEST = 3.4028235e38;

vec4 render_pixel(ivec2 pixel) {
#if READS
    if (!reads_begin(pixel, image_size.x)) {
        return vec4(0.0, 0.0, 0.0, 1.0);
    }
#endif
    uint hidden = 0u;
    bool cut = false;
    begin_ray(eye, view_direction(pixel), FARTHEST);
#if STATE_HITS || STATE_HIDDEN
    uvec4 known = state[pixel.y * image_size.x + pixel.x];
    cut = (known.w >> 31) != 0u;
#endif
#if STATE_HITS
    hit_t = uintBitsToFloat(known.x);
    hit_slot = known.y;
    hit_id = known.z;
#endif
#if STATE_HIDDEN
    hidden = known.w & 0x7fffffffu;
#endif
#if STAGE_PRIMARY
    NOTE_RAY;
    trace(false);
#endif
#if STATE_OUT
    uvec3 found = uvec3(floatBitsToUint(hit_t), hit_slot, hit_id);
#endif
    vec3 colour = vec3(0.02, 0.03, 0.05);
#if SHADE
    surface_locate(pixel);
    surface_from_hit();
#if INSTRUMENT
    uint at = record_base(pixel);
    record_ray(at, hit_t, hit_id);
#endif
    float light = 0.0;
    vec3 origin = surface_point;
    if (surface_hit) {
        origin = offset_origin();
    }
    for (int l = 0; l < LIGHTS; l++) {
        vec3 towards = lights[l] - origin;
        float reach = length(towards);
        towards /= reach;
#if STAGE_SHADOW
        if (surface_hit && (hidden & (1u << l)) == 0u) {
            begin_ray(origin, towards, reach);
            NOTE_RAY;
            trace(true);
            hidden |= hit_id != NO_PRIMITIVE ? 1u << l : 0u;
        }
#endif
#if INSTRUMENT
        if (surface_hit) {
            ray_origin = origin;
            ray_direction = towards;
            record_ray(at + 4u * uint(l + 1), reach, 1u | (((hidden >> l) & 1u) << 1));
        } else {
            records[at + 4u * uint(l + 1) + 1u] = uvec4(0u);
        }
#endif
        light += max(dot(surface_shading, towards), 0.0) * float(1u - ((hidden >> l) & 1u));
    }
    colour = surface_hit ? vec3(0.08 + 0.92 * light / float(LIGHTS)) : colour;
#else
    colour = hit_id != NO_PRIMITIVE ? vec3(scene_size / (scene_size + hit_t)) : colour;
#endif
    cut = cut || trace_stuck || budget_spent();
#if INSTRUMENT
    record_cut(at, cut);
#endif
#if READS
    reads_end();
#endif
#if STATE_OUT
    state[pixel.y * image_size.x + pixel.x] = uvec4(found, hidden | (uint(cut) << 31));
#endif
    // Alpha tells a pixel whose loops were all finished from one that was cut short.
    return vec4(sqrt(colour), cut ? 0.0 : 1.0);
}
