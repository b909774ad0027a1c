// The instrumented variant's one packed output: 4 uvec4 a pixel, then 4 for each light.
layout(std430, binding = 4) writeonly restrict buffer Records { uvec4 records[]; };
uniform ivec2 tile_origin;
uniform ivec2 tile_size;
const uint RECORD_CHUNKS = 4u * (1u + uint(LIGHTS));

uint record_base(ivec2 pixel) {
    ivec2 local = pixel - tile_origin;
    return uint(local.y * tile_size.x + local.x) * RECORD_CHUNKS;
}

void record_ray(uint at, float t, uint found) {
    records[at] = uvec4(floatBitsToUint(ray_origin), floatBitsToUint(t));
    records[at + 1u] = uvec4(floatBitsToUint(ray_direction), found);
    records[at + 2u] = counted;
    records[at + 3u] = uvec4(counted_words, 0u, 0u, 0u);
}

void record_cut(uint at, bool cut) {
    records[at + 3u].y = uint(cut);
}
