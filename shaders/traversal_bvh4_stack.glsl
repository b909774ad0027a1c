#include "common_leaf.glsl"
#include "common_stack.glsl"

// Four children a visit (Wald et al. 2008): the nearest that is entered is next, the others wait on the stack in no
// order, for sorting them costs what it spares. Every store is made, whether it is kept or not (`traversal_bvh_stack.glsl`).
const uint ROOT = 1u;                // the link of an inner node whose children are the first
const int MISSED = 0x7fffffff;       // beyond every entry

int quad_entry[4];
uint quad_link[4];

// The farther of two children comes first, unless any hit will do.
void quad_order(int a, int b, const bool any_hit) {
    bool swap = !any_hit && quad_entry[a] < quad_entry[b];
    int entry = quad_entry[a];
    uint link = quad_link[a];
    quad_entry[a] = swap ? quad_entry[b] : entry;
    quad_link[a] = swap ? quad_link[b] : link;
    quad_entry[b] = swap ? entry : quad_entry[b];
    quad_link[b] = swap ? link : quad_link[b];
}

void quad_test(int i) {
    vec3 lower, upper;
    float entry;
    bool there = quad_child(i, lower, upper, quad_link[i]);
    bool hit = box_hit(lower, upper, entry) && there;
    quad_entry[i] = hit ? floatBitsToInt(entry) : MISSED;
}

void trace(const bool any_hit) {
    uint stack[STACK_SIZE + 2];
    stack[0] = STACK_END;
    int top = 0;
    uint link = ROOT;
    do {
        if (node_axis(link) != LEAF) {
            do {
                COUNT_NODE(QUAD_WORDS);
                COUNT_VISIT(true, 0u);
                fetch_quad(node_child(link));
                quad_test(0);
                quad_test(1);
                quad_test(2);
                quad_test(3);
                quad_order(0, 1, any_hit);
                quad_order(2, 3, any_hit);
                quad_order(1, 3, any_hit);
                stack[top + 1] = quad_link[0];
                top += int(quad_entry[0] != MISSED);
                stack[top + 1] = quad_link[1];
                top += int(quad_entry[1] != MISSED);
                stack[top + 1] = quad_link[2];
                top += int(quad_entry[2] != MISSED);
                bool hit = quad_entry[3] != MISSED;
                uint popped = stack[max(top, 0)];
                link = hit ? quad_link[3] : popped;
                top -= int(!hit);
            } while (node_axis(link) != LEAF);
        }
        uint count = link == STACK_END ? 0u : node_count(link);
        COUNT_VISIT(false, count);
        intersect_slots(node_first(link), count);
        bool over = link == STACK_END || (any_hit && hit_id != NO_PRIMITIVE);
        link = over ? STACK_END : stack[max(top, 0)];
        top -= 1;
    } while (link != STACK_END);
}
