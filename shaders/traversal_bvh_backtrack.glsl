#include "common_enter.glsl"
#include "common_leaf.glsl"
#include "common_path.glsl"

// Backtracking in constant time (Binder and Keller 2016): a trail of one bit a level says where a far child waits, the
// lowest bit for the level of the walk, and a table finds that level's children by the path that leads to them
// (`renderer/pack/paths.py`).
void trace(const bool any_hit) {
    uint root;
    if (!enters_root(root)) {
        return;
    }
    bool done;
    float entry;
    uint link = root;
    uint side = 1u;
    path_clear();
    do {
        if (node_axis(link) != LEAF) {
            do {
                COUNT_VISIT(true, 0u);
                path_descend(side);
                uint near_side = (slab_octant >> node_axis(link)) & 1u;
                uint child = node_child(link) + near_side;
                uint near, far;
                bool near_hit = enters(child, entry, near);
                bool far_hit = enters(child ^ 1u, entry, far);
                path_mark(near_hit && far_hit);
                side = near_hit ? near_side : near_side ^ 1u;
                link = near_hit ? near : far_hit ? far : 0u;
            } while (node_axis(link) != LEAF);
        }
        uint count = node_count(link);
        COUNT_VISIT(false, count);
        intersect_slots(node_first(link), count);
        done = path_over() || (any_hit && hit_id != NO_PRIMITIVE);
        if (!done) {
            side = path_ascend(side) ^ 1u;
            COUNT_WORDS(2);
            link = path_link(side);
        }
    } while (!done);
}
