// Whether the ray enters a node's box, and at which t; the node's link either way.
bool enters(uint node, out float entry, out uint link) {
    COUNT_NODE(NODE_WORDS);
    vec3 lower, upper;
    fetch_node(node, lower, upper, link);
    return box_hit(lower, upper, entry);
}

bool enters_root(out uint root) {
    float entry;
    return enters(0u, entry, root);
}
