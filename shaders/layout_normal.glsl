// The paper's first layout (section 3.1): three vertices, then three normals, each a padded vec3; the id in the padding.
const int TRIANGLE_WORDS = 10;
const int NORMAL_WORDS = 9;
layout(std430, binding = 1) readonly restrict buffer Primitives { uvec4 primitives[]; };

void fetch_triangle(uint slot, out vec3 a, out vec3 b, out vec3 c, out uint id) {
    uvec4 first = primitives[slot * 6u];
    a = uintBitsToFloat(first.xyz);
    b = uintBitsToFloat(primitives[slot * 6u + 1u].xyz);
    c = uintBitsToFloat(primitives[slot * 6u + 2u].xyz);
    id = first.w;
}

void fetch_normals(uint slot, out vec3 a, out vec3 b, out vec3 c) {
    a = uintBitsToFloat(primitives[slot * 6u + 3u].xyz);
    b = uintBitsToFloat(primitives[slot * 6u + 4u].xyz);
    c = uintBitsToFloat(primitives[slot * 6u + 5u].xyz);
}
