#define SKIP_HIT box_hit
#include "common_skip.glsl"

// One order for all rays: children on the lower side of their split first.
void trace(const bool any_hit) {
    skip_walk(0u, any_hit);
}
