// The paper's third layout (section 3.1): vertices and normals in buffers of their own; the id in the padding.
const int TRIANGLE_WORDS = 10;
const int NORMAL_WORDS = 9;
layout(std430, binding = 1) readonly restrict buffer Primitives { uvec4 primitives[]; };
layout(std430, binding = 2) readonly restrict buffer Normals { uvec4 normals[]; };

void fetch_triangle(uint slot, out vec3 a, out vec3 b, out vec3 c, out uint id) {
    uvec4 first = primitives[slot * 3u];
    a = uintBitsToFloat(first.xyz);
    b = uintBitsToFloat(primitives[slot * 3u + 1u].xyz);
    c = uintBitsToFloat(primitives[slot * 3u + 2u].xyz);
    id = first.w;
}

void fetch_normals(uint slot, out vec3 a, out vec3 b, out vec3 c) {
    a = uintBitsToFloat(normals[slot * 3u].xyz);
    b = uintBitsToFloat(normals[slot * 3u + 1u].xyz);
    c = uintBitsToFloat(normals[slot * 3u + 2u].xyz);
}
