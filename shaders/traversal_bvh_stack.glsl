#include "common_leaf.glsl"
#include "common_stack.glsl"

// A link alone waits, so all that wait are looked into.
uint stack[STACK_SIZE + 2];

void stack_wait(int place, uint link, float entry) {
    stack[place] = link;
}

int stack_pass(int top, const bool any_hit) {
    return top;
}

#include "common_stack_walk.glsl"
