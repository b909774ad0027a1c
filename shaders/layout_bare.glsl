#include "common_primitives.glsl"

// Three padded vertices, the id in the padding: what every layout becomes when nothing shades with vertex normals.
const int TRIANGLE_WORDS = 10;

void fetch_triangle(uint slot, out vec3 a, out vec3 b, out vec3 c, out uint id) {
    uvec4 first = primitive_chunk(slot * 3u);
    a = uintBitsToFloat(first.xyz);
    b = uintBitsToFloat(primitive_xyz(slot * 3u + 1u));
    c = uintBitsToFloat(primitive_xyz(slot * 3u + 2u));
    id = first.w;
}
