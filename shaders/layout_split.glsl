#include "layout_bare.glsl"

// The paper's third layout (section 3.1): vertices and normals in buffers of their own.
const int NORMAL_WORDS = 9;
layout(std430, binding = 2) readonly restrict buffer Normals { uvec4 normals[]; };

void fetch_normals(uint slot, out vec3 a, out vec3 b, out vec3 c) {
    a = uintBitsToFloat(normals[slot * 3u].xyz);
    b = uintBitsToFloat(normals[slot * 3u + 1u].xyz);
    c = uintBitsToFloat(normals[slot * 3u + 2u].xyz);
}
