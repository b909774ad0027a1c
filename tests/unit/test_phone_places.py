"""Flows that a mark or other registers have given a block more, and counts on random programs."""

import random
from collections import Counter

import pytest

from renderer.phone_compile.listing import Block, Listing
from renderer.phone_compile.places import Edge, find_places
from renderer.phone_compile.sites import Where
from renderer.phone_compile.weights import weigh

SEEDS = range(20)


def listing(*blocks: tuple[tuple[int, ...], int]) -> Listing:
    """Blocks as successors and atomic operations."""
    made = tuple(Block(following, {"atomic": atomic} if atomic else {}, {}, (0, 0)) for following, atomic in blocks)
    return Listing("fragment", (), made, {"inst": 0}, None, None, 0, 0)


LOOP = (((1,), 0), ((3, 2), 0), ((1,), 0), ((), 0))


def test_a_mark_in_a_block_that_both_have() -> None:
    assert find_places(listing(*LOOP), listing(*LOOP[:2], ((1,), 1), LOOP[3])) == {2: 1}


def test_a_mark_that_made_a_block_of_an_edge() -> None:
    marked = listing(((1,), 0), ((4, 2), 0), ((3,), 1), ((1,), 0), ((), 0))
    assert find_places(listing(*LOOP), marked) in ({Edge(1, 2): 1}, {Edge(2, 1): 1}, {2: 1})


def test_a_mark_at_the_head_of_an_outer_loop_that_shared_a_block_with_the_inner_one() -> None:
    # 1 heads both loops; the mark parts them: the outer one's head is entered from before and from its end.
    plain = listing(((1,), 0), ((3, 2), 0), ((1,), 0), ((4, 1), 0), ((), 0))
    marked = listing(((1,), 0), ((2,), 1), ((4, 3), 0), ((2,), 0), ((5, 1), 0), ((), 0))
    assert find_places(plain, marked) == {Edge(0, 1): 1, Edge(3, 1): 1}


def test_moves_on_an_edge_of_the_plain_listing_alone() -> None:
    plain = listing(((1,), 0), ((4, 2), 0), ((3,), 0), ((1,), 0), ((), 0))
    marked = listing(((1,), 0), ((3, 2), 0), ((1,), 1), ((), 0))
    assert sum(find_places(plain, marked).values()) == 1


def test_another_flow_has_no_places() -> None:
    assert find_places(listing(*LOOP), listing(((1, 2), 0), ((2,), 1), ((), 0))) == {}


@pytest.mark.parametrize("seed", SEEDS)
def test_every_block_of_a_random_program_runs_as_often_as_it_did(seed: int) -> None:
    print("seed", seed)
    source = random.Random(seed)
    count = source.randint(4, 14)
    shape = [
        tuple(sorted({source.randrange(1, count), i + 1})) if source.random() < 0.6 else (i + 1,)
        for i in range(count - 1)
    ]
    shape.append(())
    runs, visits = 200, Counter[int]()
    for _ in range(runs):
        block = 0
        while True:
            visits[block] += 1
            if not shape[block]:
                break
            block = source.choice(shape[block])
    plain = listing(*((following, 0) for following in shape))
    marked = [
        ([Where(i, False)], listing(*((following, int(k == i)) for k, following in enumerate(shape))))
        for i in range(count)
    ]
    weights = weigh(plain, marked, {Where(i, False): visits[i] for i in range(count)}, runs)
    assert weights.blocks == pytest.approx([visits[i] / runs for i in range(count)], abs=1e-6)
