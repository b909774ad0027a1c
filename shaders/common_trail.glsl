// A restart trail (Laine 2010): one bit a level, the root's at the top, so that popping past the root carries out and
// leaves zero. TRAIL_WORDS is 1 for trees of depth up to 32, else 2.
#if TRAIL_WORDS == 1
const int TRAIL_TOP = 31;
uint trail;

void trail_clear() {
    trail = 0u;
}

bool trail_test(int level) {
    return (trail & (1u << level)) != 0u;
}

void trail_set(int level, bool set) {
    trail |= uint(set) << level;
}

bool trail_over() {
    return trail == 0u;
}

// Count up at `level`, dropping what is below; return the lowest set level.
int trail_pop(int level) {
    uint bit = 1u << level;
    trail = (trail & (0u - bit)) + bit;
    return findLSB(trail);
}
#else
const int TRAIL_TOP = 63;
uvec2 trail;

void trail_clear() {
    trail = uvec2(0u);
}

bool trail_test(int level) {
    uint word = level < 32 ? trail.x : trail.y;
    return (word & (1u << (level & 31))) != 0u;
}

void trail_set(int level, bool set) {
    uint bit = uint(set) << (level & 31);
    trail |= level < 32 ? uvec2(bit, 0u) : uvec2(0u, bit);
}

bool trail_over() {
    return (trail.x | trail.y) == 0u;
}

int trail_pop(int level) {
    uint bit = 1u << (level & 31);
    if (level < 32) {
        trail.x = (trail.x & (0u - bit)) + bit;
        trail.y += trail.x == 0u ? 1u : 0u;
    } else {
        trail = uvec2(0u, (trail.y & (0u - bit)) + bit);
    }
    return trail.x != 0u ? findLSB(trail.x) : 32 + findLSB(trail.y);
}
#endif
