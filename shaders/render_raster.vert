#include "common_octahedral.glsl"

// The first step of the hybrid method (paper section 3.3): the whole geometry, with its normals.
uniform mat4 projection_view;
layout(location = 0) in vec3 position;
layout(location = 1) in uint normal;
out highp vec3 world_normal;

void main() {
    world_normal = octahedral_decode(normal);
    gl_Position = projection_view * vec4(position, 1.0);
}
