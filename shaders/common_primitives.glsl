#include "common_reads.glsl"

// Reads of the primitive buffer, by chunks of four words: whole, without the padding, and what lies in the padding.
uvec4 primitive_chunk(uint i) {
    NOTE_READ(READ_PRIMITIVES, 4u, 4u * i);
    return primitives_at(i);
}

uvec3 primitive_xyz(uint i) {
    NOTE_READ(READ_PRIMITIVES, 3u, 4u * i);
    return primitives_at(i).xyz;
}

uint primitive_w(uint i) {
    NOTE_READ(READ_PRIMITIVES, 1u, 4u * i + 3u);
    return primitives_at(i).w;
}
