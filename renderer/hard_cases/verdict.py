"""Counts what answers got wrong, and whether a walk went beyond its bound."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.build.tree import KD_LEAF, Bvh, Tree
from renderer.hard_cases.ready import Ready
from renderer.judge import referee
from renderer.judge.court import EDGE, FALSE_HIT, FALSE_MISS, WRONG_PRIMITIVE, Kinds, settle
from renderer.ray_plan import Answer
from renderer.records import Flags, Rays
from renderer.variant import Variant

Counts = dict[str, int | None]


def judge_closest(ready: Ready, variant: Variant, answer: Answer) -> tuple[Counts, float | None]:
    """Counts of the closest hits' errors, and the worst t of a right one in ulps of the exact t."""
    court = ready.court(variant.intersector)
    with np.errstate(all="ignore"):
        kinds = settle(court, ready.rays, answer.hits, ready.truth, variant.intersector)
        worst = _worst_ulps(ready, answer, kinds)
    counts: Counts = {
        "false_hit": int((kinds == FALSE_HIT).sum()),
        "false_miss": int((kinds == FALSE_MISS).sum()),
        "wrong_primitive": int((kinds == WRONG_PRIMITIVE).sum()),
        "edge": int((kinds == EDGE).sum()),
        "hole": int((answer.hits.primitive < 0).sum()) if ready.case.closed else None,
        "nan": int(no_number(answer).sum()),
        "cut": int(answer.cut.sum()),
    }
    return counts, worst


def judge_any(ready: Ready, variant: Variant, answer: Answer) -> Counts:
    """Counts of the errors of "any hit"."""
    court = ready.court(variant.intersector)
    mine, truth = answer.hits.primitive >= 0, ready.truth.primitive >= 0
    wrong = np.flatnonzero(mine != truth)
    disputed, ours = ready.rays[wrong], mine[wrong]
    with np.errstate(all="ignore"):
        edge = np.where(ours, court.occluded(disputed, 1.0), ~court.occluded(disputed, -1.0))
    return {
        "any_false_hit": int((ours & ~edge).sum()),
        "any_false_miss": int((~ours & ~edge).sum()),
        "any_edge": int(edge.sum()),
    }


def no_number(answer: Answer) -> Flags:
    """Where a hit has no finite t."""
    flags: Flags = (answer.hits.primitive >= 0) & ~np.isfinite(answer.hits.t)
    return flags


def overruns(tree: Tree | None, triangles: int, answer: Answer) -> int:
    """Rays that visited more than the tree's bound.

    A walk visits every leaf once at most, and descends to each through `depth` inner nodes at most; a KD walk ends
    every leaf at another plane, so that it visits inner nodes + 1 of them.
    """
    if tree is None:
        return int((answer.counts[:, 3] > triangles).sum())
    leaf = tree.count > 0 if isinstance(tree, Bvh) else tree.axis == KD_LEAF
    inner = int((~leaf).sum())
    visits = answer.counts.astype(np.int64)
    over = (visits[:, 2] > inner + 1) | (visits[:, 1] > (inner + 1) * max(tree.depth, 1))
    return int(over.sum())


def judge_spawned(ready: Ready, first: npt.NDArray[np.int32], answer: Answer) -> Counts:
    """Counts of rays spawned at hits on the triangles `first` (n,)."""
    spawned = ready.case.spawned
    assert spawned is not None
    hit = answer.hits.primitive >= 0
    unexpected = {"free": hit, "blocked": ~hit, None: None}[spawned.expect]
    return {
        "spawned": len(hit),
        "self_hit": int((hit & (answer.hits.primitive == first)).sum()),
        "unexpected": None if unexpected is None else int(unexpected.sum()),
        "spawned_nan": int((~np.isfinite(answer.rays.origin).all(axis=1) | no_number(answer)).sum()),
    }


def spawn_rays(ready: Ready, answer: Answer) -> tuple[npt.NDArray[np.intp], Rays]:
    """Which rays hit something that others can leave, and those that leave: each to the side its first came from."""
    spawned = ready.case.spawned
    assert spawned is not None
    index = np.flatnonzero((answer.hits.primitive >= 0) & ~no_number(answer))
    corners = ready.scene.triangles[answer.hits.primitive[index]].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    came = (normal * ready.rays.direction[index]).sum(axis=1)
    goes = (normal * spawned.direction[index]).sum(axis=1)
    turn = np.where((came * goes > 0) & spawned.sided, np.float32(-1.0), np.float32(1.0))
    # Within 1e-6 of the triangle's own plane float32 cannot say on which side a ray leaves it.
    clear = (np.abs(goes) > 1e-6) & (np.abs(came) > 0)
    index, turn = index[clear], turn[clear]
    way = spawned.direction[index] * turn[:, None]
    return index, Rays(np.zeros_like(way), way, spawned.reach[index])


def _worst_ulps(ready: Ready, answer: Answer, kinds: Kinds) -> float | None:
    right = (answer.hits.primitive >= 0) & np.isin(kinds, (FALSE_HIT, WRONG_PRIMITIVE), invert=True)
    rays, primitive = ready.rays[right], answer.hits.primitive[right]
    exact = referee.plane_t(ready.scene.triangles, rays, primitive)
    usable = (np.abs(exact) < np.finfo(np.float32).max) & (exact != 0.0)
    if not usable.any():
        return None
    error = np.abs(answer.hits.t[right][usable].astype(np.float64) - exact[usable])
    return float((error / np.spacing(np.abs(exact[usable]).astype(np.float32)).astype(np.float64)).max())
