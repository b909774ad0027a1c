"""Executions of blocks from a few counts: hand-made graphs, and random ones whose walks were counted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from renderer.alu.flow import ENTRY, Fact, Graph, back_edges, loop_bodies, solve
from renderer.alu.least import least_squares


@dataclass(frozen=True)
class Block:
    """A block of a hand-made graph."""

    successors: tuple[int, ...] = ()
    calls: tuple[str, ...] = ()


LINE = {"main": (Block((1,)), Block((2,)), Block())}
DIAMOND = {"main": (Block((1, 2)), Block((3,)), Block((3,)), Block())}
WHILE = {"main": (Block((1,)), Block((2, 3)), Block((1,)), Block())}
NESTED = {"main": (Block((1,)), Block((2, 5)), Block((3, 4)), Block((2,)), Block((1,)), Block())}


def test_a_straight_line_runs_once() -> None:
    flow = solve(LINE, "main", [])
    assert flow.blocks["main"].tolist() == [1.0, 1.0, 1.0]
    assert flow.residual == 0.0


def test_an_open_branch_goes_both_ways_alike() -> None:
    assert solve(DIAMOND, "main", []).blocks["main"] == pytest.approx([1.0, 0.5, 0.5, 1.0])


def test_branches_within_an_open_branch_split_its_half() -> None:
    graph = {"main": (Block((1, 4)), Block((2, 3)), Block((3,)), Block((4,)), Block())}
    assert solve(graph, "main", []).blocks["main"] == pytest.approx([1.0, 0.5, 0.25, 0.5, 1.0])


def test_a_counted_side_leaves_the_rest_to_the_other() -> None:
    flow = solve(DIAMOND, "main", [Fact("left", {("main", 1): 1.0}, 0.125)])
    assert flow.blocks["main"] == pytest.approx([1.0, 0.125, 0.875, 1.0])


def test_a_loop_turns_as_counted_and_its_head_once_more() -> None:
    flow = solve(WHILE, "main", [Fact("turns", {("main", 2): 1.0}, 1234.5)])
    assert flow.blocks["main"] == pytest.approx([1.0, 1235.5, 1234.5, 1.0])


def test_an_open_loop_does_not_turn() -> None:
    assert solve(WHILE, "main", []).blocks["main"] == pytest.approx([1.0, 1.0, 0.0, 1.0])


def test_a_bound_turns_a_loop_no_more_than_it_asks() -> None:
    facts = [Fact("inner", {("main", 3): 1.0}, 90.0), Fact("outer", {("main", 4): 1.0}, 7.0, "least")]
    assert solve(NESTED, "main", facts).blocks["main"] == pytest.approx([1.0, 8.0, 97.0, 90.0, 7.0, 1.0])


def test_two_loops_with_one_count_share_it() -> None:
    graph = {"main": (Block((1,)), Block((2, 3)), Block((1,)), Block((4, 5)), Block((3,)), Block())}
    flow = solve(graph, "main", [Fact("both", {("main", 2): 1.0, ("main", 4): 1.0}, 10.0)])
    assert flow.blocks["main"] == pytest.approx([1.0, 6.0, 5.0, 6.0, 5.0, 1.0])


def test_two_counters_with_other_weights_tell_two_loops_apart() -> None:
    graph = {"main": (Block((1,)), Block((2, 3)), Block((1,)), Block((4, 5)), Block((3,)), Block())}
    sites = {("main", 2): 1.0, ("main", 4): 1.0}
    words = {("main", 2): 8.0, ("main", 4): 1.0}
    flow = solve(graph, "main", [Fact("nodes", sites, 10.0), Fact("words", words, 8.0 * 7 + 3)])
    assert flow.blocks["main"] == pytest.approx([1.0, 8.0, 7.0, 4.0, 3.0, 1.0])


def test_calls_enter_a_routine_from_every_site() -> None:
    graph: Graph = {
        "leaf": (Block(),),
        "walk": (Block((1,)), Block((2, 3)), Block((1,), ("leaf", "leaf")), Block()),
        "main": (Block((1, 2), ("walk",)), Block((2,), ("walk", "leaf")), Block()),
        "unused": (Block((), ("leaf",)),),
    }
    facts = [Fact("walks", {("walk", ENTRY): 1.0}, 1.25), Fact("steps", {("walk", 2): 1.0}, 40.0)]
    flow = solve(graph, "main", facts)
    assert flow.entries == pytest.approx({"main": 1.0, "walk": 1.25, "leaf": 80.25, "unused": 0.0})
    assert flow.blocks["unused"].tolist() == [0.0]


def test_recursion_is_refused() -> None:
    with pytest.raises(ValueError, match="calls itself"):
        solve({"main": (Block((), ("main",)),)}, "main", [])


def test_counts_that_contradict_show_in_the_residual() -> None:
    facts = [Fact("left", {("main", 1): 1.0}, 0.5), Fact("right", {("main", 2): 1.0}, 0.8)]
    flow = solve(DIAMOND, "main", facts)
    assert 0.05 < flow.residual < 0.3
    assert solve(DIAMOND, "main", [Fact("no such step", {}, 5.0)]).residual == pytest.approx(1.0)


def test_a_small_contradiction_moves_the_counts_little() -> None:
    facts = [Fact("turns", {("main", 2): 1.0}, 100.0), Fact("again", {("main", 2): 1.0}, 100.4)]
    flow = solve(WHILE, "main", facts)
    assert 0.001 < flow.residual < 0.003
    assert flow.blocks["main"][2] == pytest.approx(100.2, abs=0.1)


def test_loops_are_found() -> None:
    assert back_edges(NESTED["main"]) == {(3, 2), (4, 1)}
    assert loop_bodies(NESTED["main"]) == [{2, 3}, {1, 2, 3, 4}]


@pytest.mark.parametrize("seed", range(20))
def test_counted_walks_are_found_again(seed: int) -> None:
    """Random structured programs; every loop and one side of every branch is counted, the rest must follow."""
    rng = np.random.default_rng(seed)
    nodes, counted = program(rng)
    ran = np.zeros(len(nodes))
    walks = 50
    for _ in range(walks):
        block = 0
        while True:
            ran[block] += 1
            if not nodes[block].successors:
                break
            # The last way leaves a loop; it is taken often enough for walks to end.
            ways = nodes[block].successors
            block = ways[int(rng.choice(len(ways), p=[0.4, 0.6] if len(ways) == 2 else None))]
    facts = [Fact(f"block {block}", {("main", block): 1.0}, ran[block] / walks) for block in counted]
    flow = solve({"main": nodes}, "main", facts)
    assert flow.residual < 1e-9
    assert flow.blocks["main"] * walks == pytest.approx(ran, abs=1e-6)


def program(rng: np.random.Generator) -> tuple[list[Block], list[int]]:
    """A random nest of sequences, branches and loops, and the blocks whose counts tell all others."""
    after: list[list[int]] = [[]]
    counted: list[int] = []

    def block() -> int:
        after.append([])
        return len(after) - 1

    def part(start: int, depth: int) -> int:
        """Grow from the block `start`; return the block at the end."""
        end = start
        for _ in range(int(rng.integers(1, 4))):
            kind = rng.integers(3) if depth else 0
            inside, merge = block(), 0
            if kind == 0:
                after[end].append(inside)
                end = inside
                continue
            head = end
            if kind == 2:
                head = block()
                after[end].append(head)
            after[head].append(inside)
            counted.append(inside)
            last = part(inside, depth - 1)
            merge = block()
            after[head].append(merge)
            after[last].append(head if kind == 2 else merge)
            end = merge
        return end

    part(0, 3)
    return [Block(tuple(ways)) for ways in after], counted


@pytest.mark.parametrize("seed", range(20))
def test_least_squares_is_the_best_of_all_choices_of_zeros(seed: int) -> None:
    """Against every subset of entries held at zero, on problems without freedom, most of them contradictory."""
    rng = np.random.default_rng(seed)
    matrix, side = rng.normal(size=(7, 5)), rng.normal(size=7)
    best = np.inf
    for mask in range(2**5):
        free = [i for i in range(5) if mask >> i & 1]
        part = np.linalg.lstsq(matrix[:, free], side, rcond=None)[0] if free else np.zeros(0)
        if (part >= 0).all():
            best = min(best, float(np.linalg.norm(matrix[:, free] @ part - side)))
    solved = least_squares(matrix, side, ())
    assert (solved >= 0).all()
    assert np.linalg.norm(matrix @ solved - side) == pytest.approx(best, rel=1e-6)
