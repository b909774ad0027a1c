// Reads of storage buffers, recorded. With READS, a pixel of a chosen block of 8x8 appends a word for every read to its
// part of one buffer (`renderer/reads.py` reads it): which buffer, 2 bits; how many words less one, 2 bits; which word
// is the first, 28 bits. A word of all ones in its first two bits says that the next ray is traced.
#if READS
const uint READ_NODES = 0u;
const uint READ_PRIMITIVES = 1u;
const uint READ_NORMALS = 2u;
const uint READ_RAY = 3u;

// For each block of the image 0, or where in this buffer its 64 pixels' parts begin; the next entry ends the last.
layout(std430, binding = 5) readonly restrict buffer Places { uint places[]; };
// A pixel's part: how many words it made, then as many of them as there is room for.
layout(std430, binding = 6) writeonly restrict buffer Reads { uint reads[]; };
uint reads_part;
uint reads_room;
uint reads_made;

bool reads_begin(ivec2 pixel, int image_width) {
    uint place = places[(pixel.y >> 3) * ((image_width + 7) >> 3) + (pixel.x >> 3)];
    uint lane = uint((pixel.y & 7) * 8 + (pixel.x & 7));
    reads_part = places[place + lane];
    reads_room = places[place + lane + 1u] - reads_part - 1u;
    reads_made = 0u;
    return place != 0u;
}

void reads_note(uint word) {
    if (reads_made < reads_room) {
        reads[reads_part + 1u + reads_made] = word;
    }
    reads_made += 1u;
}

void reads_end() {
    reads[reads_part] = reads_made;
}

#define NOTE_READ(source, words, first) reads_note((source << 30) | ((words - 1u) << 28) | (first))
#define NOTE_RAY reads_note(READ_RAY << 30)
#else
#define NOTE_READ(source, words, first)
#define NOTE_RAY
#endif
