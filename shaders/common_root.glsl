// Whether the ray enters the root's box, and the root's link either way.
bool enters_root(out uint root) {
    COUNT_NODE(NODE_WORDS);
    vec3 lower, upper;
    float entry;
    fetch_node(0u, lower, upper, root);
    return box_hit(lower, upper, entry);
}
