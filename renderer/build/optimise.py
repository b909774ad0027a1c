"""How long a BVH is worked on by re-insertion, and in what turn."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from renderer.build.loose import Loose, reach_of
from renderer.build.progress import Told
from renderer.build.reinsert import reinserted
from renderer.build.reinsert_pairs import pairs_reinserted

Round = Callable[[Loose], Loose]

SINGLE: Round = partial(reinserted, share=0.3)
PAIRS: Round = partial(pairs_reinserted, share=0.02)

SHORT: Sequence[Round] = (SINGLE,) * 4
LONG: Sequence[Round] = (SINGLE,) * 4 + (PAIRS,) * 6 + (SINGLE,) * 3
"""Single moves win most at first, pairs get on where these end, and single moves tidy up after them."""


def optimised(tree: Loose, rounds: Sequence[Round], max_depth: int, told: Told) -> Loose:
    """`tree` after all `rounds`; what one makes deeper than `max_depth` is left out."""
    for number, work in enumerate(rounds):
        after = work(tree)
        if reach_of(after) <= max_depth:
            tree = after
        told((number + 1) / len(rounds))
    return tree
