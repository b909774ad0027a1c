// Baldwin and Weber 2016: an affine map, made beforehand, takes the triangle to (0,0,0), (1,0,0), (0,1,0). One axis is
// kept, the one that the normal has most of, so nine numbers say it all; the triangle's box and id lie with them
// (`renderer/pack/baked.py`), and vertices are read for shading alone. The numbers are relative to the world's origin:
// unlike tests that begin with a corner less the ray's origin, this one loses digits with the distance from there.
const int TEST_WORDS = 16;

uvec4 baked_chunk(uint i) {
    NOTE_READ(READ_NORMALS, 4u, 4u * i);
    return baked_at(i);
}

void intersector_prepare() {
}

// Axes in cyclic order, the kept one first.
vec3 baked_axes(vec3 v, uint axis) {
    return axis == 0u ? v : axis == 1u ? v.yzx : v.zxy;
}

void intersect(uint slot) {
    uvec4 plane = baked_chunk(slot * 4u);
    vec4 across = uintBitsToFloat(baked_chunk(slot * 4u + 1u));
    vec4 rest = uintBitsToFloat(baked_chunk(slot * 4u + 2u));
    vec4 corners = uintBitsToFloat(baked_chunk(slot * 4u + 3u));
    vec3 height = uintBitsToFloat(plane.xyz);
    vec3 from = baked_axes(slab_origin, plane.w & 3u);
    vec3 along = baked_axes(ray_direction, plane.w & 3u);
    PRECISE float above = from.x + (height.x * from.y + (height.y * from.z + height.z));
    PRECISE float fall = along.x + (height.x * along.y + height.y * along.z);
    PRECISE float t = -above / fall;
    PRECISE vec2 at = from.yz + t * along.yz;
    PRECISE float u = across.x * at.x + (across.y * at.y + across.z);
    PRECISE float v = across.w * at.x + (rest.x * at.y + rest.y);
    vec3 lower = vec3(rest.zw, corners.x);
    float entry = slab_entry(lower, corners.yzw);
    PRECISE float leave = slab_exit(lower, corners.yzw) * WIDEN;
    bool inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && entry <= leave;
    take_hit(inside, clamp(t, entry, leave), slot, plane.w >> 2);
}
