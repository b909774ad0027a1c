#include "common_octahedral.glsl"

in highp vec3 world_normal;
layout(location = 0) out highp uint normal;

void main() {
    normal = octahedral_encode(normalize(world_normal));
}
