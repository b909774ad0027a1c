#include "common_primitives.glsl"

// The paper's first layout (section 3.1): three vertices, then three normals, each a padded vec3; the id in the padding.
const int TRIANGLE_WORDS = 10;
const int NORMAL_WORDS = 9;

void fetch_triangle(uint slot, out vec3 a, out vec3 b, out vec3 c, out uint id) {
    uvec4 first = primitive_chunk(slot * 6u);
    a = uintBitsToFloat(first.xyz);
    b = uintBitsToFloat(primitive_xyz(slot * 6u + 1u));
    c = uintBitsToFloat(primitive_xyz(slot * 6u + 2u));
    id = first.w;
}

void fetch_normals(uint slot, out vec3 a, out vec3 b, out vec3 c) {
    a = uintBitsToFloat(primitive_xyz(slot * 6u + 3u));
    b = uintBitsToFloat(primitive_xyz(slot * 6u + 4u));
    c = uintBitsToFloat(primitive_xyz(slot * 6u + 5u));
}
