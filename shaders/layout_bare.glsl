// Three padded vertices, the id in the padding: what every layout becomes when nothing shades with vertex normals.
const int TRIANGLE_WORDS = 10;
layout(std430, binding = 1) readonly restrict buffer Primitives { uvec4 primitives[]; };

void fetch_triangle(uint slot, out vec3 a, out vec3 b, out vec3 c, out uint id) {
    uvec4 first = primitives[slot * 3u];
    a = uintBitsToFloat(first.xyz);
    b = uintBitsToFloat(primitives[slot * 3u + 1u].xyz);
    c = uintBitsToFloat(primitives[slot * 3u + 2u].xyz);
    id = first.w;
}
