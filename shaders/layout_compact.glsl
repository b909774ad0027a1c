#include "common_primitives.glsl"

// The paper's second layout (section 3.1): the first normal fills the padding of the three vertices, the id that of
// the second normal.
const int TRIANGLE_WORDS = 10;
const int NORMAL_WORDS = 9;

void fetch_triangle(uint slot, out vec3 a, out vec3 b, out vec3 c, out uint id) {
    a = uintBitsToFloat(primitive_xyz(slot * 5u));
    b = uintBitsToFloat(primitive_xyz(slot * 5u + 1u));
    c = uintBitsToFloat(primitive_xyz(slot * 5u + 2u));
    id = primitive_w(slot * 5u + 3u);
}

void fetch_normals(uint slot, out vec3 a, out vec3 b, out vec3 c) {
    uint x = primitive_w(slot * 5u);
    uint y = primitive_w(slot * 5u + 1u);
    uint z = primitive_w(slot * 5u + 2u);
    a = uintBitsToFloat(uvec3(x, y, z));
    b = uintBitsToFloat(primitive_xyz(slot * 5u + 3u));
    c = uintBitsToFloat(primitive_xyz(slot * 5u + 4u));
}
