"""Where a marked site lies in the plain listing: in a block, or on edges where the plain one has no block.

A mark can make a block of what was an edge, and other registers can need moves on an edge, which become a block of
theirs. Blocks with one way out are therefore taken away on either side, as few as it takes for both flows to be alike.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

from renderer.phone_compile.listing import Listing

Shape = tuple[tuple[int, ...], ...]
"""The successors of each block."""

_MOST = ((0, 0), (0, 1), (1, 0), (1, 1), (0, 2), (2, 0), (1, 2), (2, 1))
"""How many blocks are taken from the plain and from the marked listing, in the order of trying."""


@dataclass(frozen=True)
class Edge:
    """The way from one block to another."""

    before: int
    after: int


Place = int | Edge


def find_places(plain: Listing, marked: Listing) -> dict[Place, int]:
    """How many more atomic operations the marked listing has at each place of the plain one; none where their flows
    are too different."""
    atomics = [block.kinds.get("atomic", 0) for block in marked.blocks]
    for from_plain, from_marked in _MOST:
        if len(plain.blocks) - from_plain != len(marked.blocks) - from_marked:
            continue
        for away_plain in _choices(plain.shape, from_plain, ()):
            contracted = _contracted(plain.shape, away_plain)
            for away_marked in _choices(marked.shape, from_marked, atomics):
                if _contracted(marked.shape, away_marked) == contracted:
                    return _placed(plain, marked, away_plain, away_marked)
    return {}


def _choices(shape: Shape, count: int, atomics: Sequence[int]) -> Iterator[frozenset[int]]:
    """The sets of `count` blocks that may be taken away: those with one way out, and one way in or a mark."""
    ways_in = [0] * len(shape)
    for following in shape:
        for after in following:
            ways_in[after] += 1
    may = [
        i
        for i, following in enumerate(shape)
        if i and len(following) == 1 and following != (i,) and (ways_in[i] == 1 or (atomics and atomics[i]))
    ]
    yield from map(frozenset, itertools.combinations(may, count))


def _contracted(shape: Shape, away: Collection[int]) -> Shape:
    """The shape without some blocks, each block's successors in order of their numbers."""
    numbers = {old: new for new, old in enumerate(i for i in range(len(shape)) if i not in away)}
    return tuple(
        tuple(sorted(numbers[_beyond(shape, after, away)] for after in following))
        for i, following in enumerate(shape)
        if i not in away
    )


def _beyond(shape: Shape, block: int, away: Collection[int]) -> int:
    """The first block that stays, from one on."""
    for _ in range(len(away)):
        if block in away:
            (block,) = shape[block]
    return block


def _placed(
    plain: Listing, marked: Listing, away_plain: frozenset[int], away_marked: frozenset[int]
) -> dict[Place, int]:
    kept = [i for i in range(len(plain.blocks)) if i not in away_plain]
    same = dict(zip((i for i in range(len(marked.blocks)) if i not in away_marked), kept, strict=True))
    places: dict[Place, int] = {}
    for i, block in enumerate(marked.blocks):
        times = block.kinds.get("atomic", 0)
        if i in same:
            times -= plain.blocks[same[i]].kinds.get("atomic", 0)
            found: list[Place] = [same[i]]
        else:
            found = _on_edges(plain.shape, marked.shape, i, same, away_plain, away_marked) if times else []
            if times and not found:
                return {}
        for place in found:
            if times > 0:
                places[place] = places.get(place, 0) + times
    return places


def _on_edges(
    plain: Shape,
    marked: Shape,
    gone: int,
    same: dict[int, int],
    away_plain: Collection[int],
    away_marked: Collection[int],
) -> list[Place]:
    """The edges of the plain shape that stand for a block of the marked one; none where one of them is ambiguous."""
    after = same[_beyond(marked, gone, away_marked)]
    found: list[Place] = []
    for before in _befores(marked, gone, away_marked):
        ways = [way for way in plain[same[before]] if _beyond(plain, way, away_plain) == after]
        if len(ways) != 1:
            return []
        found.append(ways[0] if ways[0] in away_plain else Edge(same[before], after))
    return found


def _befores(shape: Shape, block: int, away: Collection[int]) -> list[int]:
    """The blocks that stay and lead to one, over others that do not stay."""
    found = []
    for i, following in enumerate(shape):
        if block in following:
            found += _befores(shape, i, away) if i in away else [i]
    return found
