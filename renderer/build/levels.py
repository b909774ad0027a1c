"""A binary tree a level at a time, for numpy: loading the compiler takes longer than a pass over a million nodes."""

from __future__ import annotations

import numpy as np

from renderer.build.tree import Ints


def inner_levels(child: Ints, count: Ints) -> list[Ints]:
    """The inner nodes of each level that has any, the root's first."""
    found, level = list[Ints](), np.zeros(1, np.int32)
    while len(inner := level[count[level] == 0]):
        found.append(inner)
        left = child[inner]
        level = np.stack([left, left + 1], axis=1).ravel()
    return found


def summed(own: Ints, child: Ints, levels: list[Ints]) -> Ints:
    """What each node has of `own` (n,), with all that is below it."""
    sums = own.copy()
    for inner in reversed(levels):
        left = child[inner]
        sums[inner] += sums[left] + sums[left + 1]
    return sums


def first_slots(child: Ints, levels: list[Ints]) -> Ints:
    """The first of the slots that the triangles below each node fill."""
    firsts = child.copy()
    for inner in reversed(levels):
        firsts[inner] = firsts[child[inner]]
    return firsts
