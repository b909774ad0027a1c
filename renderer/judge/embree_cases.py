"""Where Embree is wrong and the referee is not: each kept as the ray and the few triangles that show it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from renderer.build.tree import Bvh
from renderer.judge import referee
from renderer.judge.court import AGREE, EDGE, EMBREE, Court, hits_of, settle
from renderer.judge.oracle import Oracle
from renderer.records import Floats, Hits, Rays


@dataclass(frozen=True)
class EmbreeCase:
    """One ray that Embree answers wrongly; numbers are written by `float.hex`, so that none is rounded.

    `origin`, `direction`, `reach` are the ray, `triangles` the corners of the triangle that is hit and of the one that
    Embree names, in that order, either of which may be missing. `embree` and `truth` are the places of the two
    answers in `triangles`, -1 for a miss, and the values of t. `edge` says that float32 may err there. `alone` says
    that Embree still errs where these triangles are its whole scene; else it errs in the scene alone.
    """

    origin: tuple[str, ...]
    direction: tuple[str, ...]
    reach: str
    triangles: tuple[tuple[str, ...], ...]
    embree: tuple[int, str]
    truth: tuple[int, str]
    edge: bool
    alone: bool

    def to_json(self) -> dict[str, Any]:
        """Plain JSON values."""
        return asdict(self)


def embree_cases(triangles: Floats, rays: Rays, oracle: Oracle, bvh: Bvh | None, most: int = 20) -> list[EmbreeCase]:
    """Up to `most` of the closest hits in which Embree's answer is neither the referee's nor a tie with it."""
    court = Court(triangles, oracle, bvh, True, EMBREE)
    found, truth = oracle.closest(rays), court.truth(rays)
    suspects = np.flatnonzero(found.primitive != truth.primitive)
    right = referee.Verdict(truth.t[suspects], truth.primitive[suspects])
    kinds = settle(court, rays[suspects], hits_of(found, suspects), right, EMBREE)
    wrong = np.flatnonzero(kinds != AGREE)[:most]
    return [_case(triangles, rays, found, truth, int(suspects[k]), bool(kinds[k] == EDGE)) for k in wrong]


def _case(triangles: Floats, rays: Rays, found: Hits, truth: referee.Verdict, r: int, edge: bool) -> EmbreeCase:
    named = (int(truth.primitive[r]), int(found.primitive[r]))
    kept = [i for i in named if i >= 0]
    places = [kept.index(i) if i >= 0 else -1 for i in named]
    few = np.ascontiguousarray(triangles[kept])
    ray = rays[r : r + 1]
    again = Oracle(few).closest(ray)
    return EmbreeCase(
        origin=_hex(ray.origin),
        direction=_hex(ray.direction),
        reach=_hex(ray.reach)[0],
        triangles=tuple(_hex(triangle) for triangle in few),
        embree=(places[1], float(found.t[r]).hex()),
        truth=(places[0], float(truth.t[r]).hex()),
        edge=edge,
        alone=int(again.primitive[0]) == places[1],
    )


def _hex(values: Floats) -> tuple[str, ...]:
    return tuple(float(value).hex() for value in values.ravel())
