#include "common_leaf.glsl"
#include "common_stack.glsl"

// Where the ray enters a box waits with its link, so that what `box_hit` would miss behind a hit by then is passed over.
uint stack[STACK_SIZE + 2];
float stack_entry[STACK_SIZE + 2];

void stack_wait(int place, uint link, float entry) {
    stack[place] = link;
    stack_entry[place] = entry;
}

int stack_pass(int top, const bool any_hit) {
    while (!any_hit && top > 0 && stack_entry[max(top, 0)] > hit_t * WIDEN) {
        top -= 1;
    }
    return top;
}

#include "common_stack_walk.glsl"
