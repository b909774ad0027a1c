// Mesa 22 silently stops an invocation's loops after 65,535 iterations, summed over all of them. A loop whose length
// the compiler cannot know, run last, tells: once the budget is spent it ends after one turn of its two. The two
// components of the uniform are equal, and no compiler can fold what compares them.
uniform uvec2 budget_turns;

bool budget_spent() {
    uint turn = 0u;
    while (turn < budget_turns.x) {
        turn += 1u;
    }
    return turn != budget_turns.y;
}
