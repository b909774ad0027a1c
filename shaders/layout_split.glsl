#include "layout_bare.glsl"

// The paper's third layout (section 3.1): vertices and normals in buffers of their own.
const int NORMAL_WORDS = 9;

uvec3 normal_xyz(uint i) {
    NOTE_READ(READ_NORMALS, 3u, 4u * i);
    return normals_at(i).xyz;
}

void fetch_normals(uint slot, out vec3 a, out vec3 b, out vec3 c) {
    a = uintBitsToFloat(normal_xyz(slot * 3u));
    b = uintBitsToFloat(normal_xyz(slot * 3u + 1u));
    c = uintBitsToFloat(normal_xyz(slot * 3u + 2u));
}
