// The paper's second layout (section 3.1): the first normal fills the padding of the three vertices, the id that of
// the second normal.
const int TRIANGLE_WORDS = 10;
const int NORMAL_WORDS = 9;
layout(std430, binding = 1) readonly restrict buffer Primitives { uvec4 primitives[]; };

void fetch_triangle(uint slot, out vec3 a, out vec3 b, out vec3 c, out uint id) {
    a = uintBitsToFloat(primitives[slot * 5u].xyz);
    b = uintBitsToFloat(primitives[slot * 5u + 1u].xyz);
    c = uintBitsToFloat(primitives[slot * 5u + 2u].xyz);
    id = primitives[slot * 5u + 3u].w;
}

void fetch_normals(uint slot, out vec3 a, out vec3 b, out vec3 c) {
    a = uintBitsToFloat(
        uvec3(primitives[slot * 5u].w, primitives[slot * 5u + 1u].w, primitives[slot * 5u + 2u].w));
    b = uintBitsToFloat(primitives[slot * 5u + 3u].xyz);
    c = uintBitsToFloat(primitives[slot * 5u + 4u].xyz);
}
