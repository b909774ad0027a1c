// The ray being traced and its closest hit so far. Globals, not a struct: some phone compilers keep struct members
// at 16 bits in fragment shaders.
const uint NO_PRIMITIVE = 0xffffffffu;

vec3 ray_origin;
vec3 ray_direction;
float hit_t;       // the ray's reach until something nearer is hit
uint hit_slot;     // where the hit triangle lies in the primitive buffer
uint hit_id;       // which triangle of the scene it is; NO_PRIMITIVE for a miss
bool trace_stuck = false;  // a walk was ended because it did not get on; its pixel counts as cut

// The closest hit is the smallest t, then the smallest id (ARCHITECTURE.md).
void take_hit(bool inside, float t, uint slot, uint id) {
    bool nearer = inside && (t < hit_t || (t == hit_t && id < hit_id));
    hit_t = nearer ? t : hit_t;
    hit_slot = nearer ? slot : hit_slot;
    hit_id = nearer ? id : hit_id;
}

#if INSTRUMENT
uvec4 counted;       // nodes fetched, inner nodes visited, leaves visited, triangles tested
uint counted_words;  // 4-byte words fetched from storage buffers
#define COUNT_NODE(words) counted.x += 1u; counted_words += uint(words)
#define COUNT_INNER counted.y += 1u
#define COUNT_LEAF counted.z += 1u
#define COUNT_VISIT(inner, triangles) counted.y += uint(inner); counted.z += uint((triangles) > 0u)
#define COUNT_TRIANGLE(words) counted.w += 1u; counted_words += uint(words)
#define COUNT_WORDS(words) counted_words += uint(words)
#else
#define COUNT_NODE(words)
#define COUNT_INNER
#define COUNT_LEAF
#define COUNT_VISIT(inner, triangles)
#define COUNT_TRIANGLE(words)
#define COUNT_WORDS(words)
#endif
