// The path to an inner node: a 1, then a bit for each edge from the root, and beside it a trail whose bits say at which of
// its levels a child waits. TRAIL_WORDS is 1 for trees of depth up to 32, else 2. The walk stands at a child of that node.
uint path_mixed(uint x) {
    x = (x ^ (x >> 16)) * 0x7feb352du;
    x = (x ^ (x >> 15)) * 0x846ca68bu;
    return x ^ (x >> 16);
}

uint path_share(uint hashed, uint parts) {
    uint high, low;
    umulExtended(hashed, parts, high, low);
    return high;
}

#if TRAIL_WORDS == 1
uint path;
uint trail;

void path_clear() {
    path = 0u;
    trail = 0u;
}

void path_descend(uint side) {
    path = path << 1 | side;
    trail <<= 1;
}

void path_mark(bool waits) {
    trail |= uint(waits);
}

bool path_over() {
    return trail == 0u;
}

// Up to the lowest level where a child waits, which then does no longer; on which side the walk stood there.
uint path_ascend(uint side) {
    int up = findLSB(trail);
    side = up > 0 ? path >> max(up - 1, 0) & 1u : side;
    path >>= up;
    trail = trail >> up ^ 1u;
    return side;
}

#define PATH_LOW path
#define PATH_HIGH 0u
#else
uvec2 path;  // the lower word first
uvec2 trail;

void path_clear() {
    path = uvec2(0u);
    trail = uvec2(0u);
}

uvec2 path_down(uvec2 words, uint bit) {
    return uvec2(words.x << 1 | bit, words.y << 1 | words.x >> 31);
}

// By less than 64.
uvec2 path_up(uvec2 words, int by) {
    uvec2 within = by < 32 ? words : uvec2(words.y, 0u);
    int rest = by & 31;
    return uvec2(within.x >> rest | within.y << 1 << (31 - rest), within.y >> rest);
}

void path_descend(uint side) {
    path = path_down(path, side);
    trail = path_down(trail, 0u);
}

void path_mark(bool waits) {
    trail.x |= uint(waits);
}

bool path_over() {
    return (trail.x | trail.y) == 0u;
}

uint path_ascend(uint side) {
    int up = trail.x != 0u ? findLSB(trail.x) : 32 + findLSB(trail.y);
    side = up > 0 ? path_up(path, max(up - 1, 0)).x & 1u : side;
    path = path_up(path, up);
    trail = path_up(trail, up);
    trail.x ^= 1u;
    return side;
}

#define PATH_LOW path.x
#define PATH_HIGH path.y
#endif

// The link word of the child on that side of the node that the path leads to.
uint path_link(uint side) {
    uint bucket = path_share(path_mixed(PATH_LOW ^ path_mixed(PATH_HIGH)), PATH_BUCKETS);
    uint displacement = node_path_word(bucket);
    uint at = path_share(path_mixed(PATH_LOW + path_mixed(PATH_HIGH + displacement + 1u)), PATH_ENTRIES);
    return node_path_word(PATH_BUCKETS + 2u * at + side);
}
