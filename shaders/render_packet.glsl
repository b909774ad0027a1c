// A block of pixels, each as in `render_pixel.glsl`, whose rays are traced together: all primary rays, then for each light
// all shadow rays.
#include "common_budget.glsl"

uniform vec3 lights[LIGHTS];
uniform float scene_size;  // the diagonal of the bounds

#if STATE_HITS || STATE_OUT
layout(std430, binding = 3) restrict buffer State { uvec4 state[]; };  // t, slot, id, bit 31: cut
#endif

const float FARTHEST = 3.4028235e38;

vec3 packet_start[PACKET];
vec3 packet_shading[PACKET];
float packet_light[PACKET];
bool packet_lit[PACKET];  // whether there is a surface

bool inside_image(ivec2 pixel) {
    return all(lessThan(pixel, image_size));
}

void packet_surface(ivec2 corner, int k) {
    packet_take(k, false);
    ivec2 pixel = packet_pixel(corner, k);
    surface_locate(pixel);
    surface_from_hit();
#if INSTRUMENT
    if (inside_image(pixel)) {
        record_ray(record_base(pixel), hit_t, hit_id);
    }
#endif
    packet_start[k] = surface_point;
    if (surface_hit) {
        packet_start[k] = offset_origin();
    }
    packet_lit[k] = surface_hit;
    packet_shading[k] = surface_shading;
    packet_light[k] = 0.0;
}

void packet_begin_shadow(int k, int l) {
    vec3 towards = lights[l] - packet_start[k];
    float reach = length(towards);
    begin_ray(packet_start[k], towards / reach, reach);
    packet_keep(k, packet_lit[k]);
}

void packet_end_shadow(ivec2 corner, int k, int l) {
    bool hidden = packet_id[k] != NO_PRIMITIVE;
#if INSTRUMENT
    ivec2 pixel = packet_pixel(corner, k);
    if (inside_image(pixel)) {
        uint at = record_base(pixel) + 4u * uint(l + 1);
        packet_take(k, false);
        vec3 towards = lights[l] - packet_start[k];
        record_ray(at, length(towards), 1u | (uint(hidden) << 1));
        if (!packet_lit[k]) {
            records[at + 1u] = uvec4(0u);
        }
    }
#endif
    packet_light[k] += max(dot(packet_shading[k], packet_direction[k]), 0.0) * (hidden ? 0.0 : 1.0);
}

void render_packet(ivec2 corner) {
    for (int k = 0; k < PACKET; k++) {
        ivec2 pixel = packet_pixel(corner, k);
        begin_ray(eye, view_direction(pixel), FARTHEST);
#if STATE_HITS
        uvec4 known = inside_image(pixel) ? state[pixel.y * image_size.x + pixel.x] : uvec4(0u, 0u, NO_PRIMITIVE, 0u);
        hit_t = uintBitsToFloat(known.x);
        hit_slot = known.y;
        hit_id = known.z;
#endif
        packet_keep(k, inside_image(pixel));
    }
#if STAGE_PRIMARY
    trace(false);
#endif
#if STATE_OUT
    uvec3 found[PACKET];
    for (int k = 0; k < PACKET; k++) {
        found[k] = uvec3(floatBitsToUint(packet_t[k]), packet_slot[k], packet_id[k]);
    }
#endif
#if SHADE
    for (int k = 0; k < PACKET; k++) {
        packet_surface(corner, k);
    }
    for (int l = 0; l < LIGHTS; l++) {
        for (int k = 0; k < PACKET; k++) {
            packet_begin_shadow(k, l);
        }
#if STAGE_SHADOW
        trace(true);
#endif
        for (int k = 0; k < PACKET; k++) {
            packet_end_shadow(corner, k, l);
        }
    }
#endif
    bool cut = trace_stuck || budget_spent();
    for (int k = 0; k < PACKET; k++) {
        vec3 colour = vec3(0.02, 0.03, 0.05);
#if SHADE
        colour = packet_lit[k] ? vec3(0.08 + 0.92 * packet_light[k] / float(LIGHTS)) : colour;
#else
        colour = packet_id[k] != NO_PRIMITIVE ? vec3(scene_size / (scene_size + packet_t[k])) : colour;
#endif
        packet_shown[k] = vec4(sqrt(colour), cut ? 0.0 : 1.0);
#if INSTRUMENT || STATE_OUT
        ivec2 pixel = packet_pixel(corner, k);
        if (inside_image(pixel)) {
#if INSTRUMENT
            record_cut(record_base(pixel), cut);
#endif
#if STATE_OUT
            state[pixel.y * image_size.x + pixel.x] = uvec4(found[k], uint(cut) << 31);
#endif
        }
#endif
    }
}
