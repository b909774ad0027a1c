"""Measures one cell: a variant on a family's case."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from renderer.build.errors import BuildError
from renderer.hard_cases.asking import Asker, Setup
from renderer.hard_cases.cell import Cell
from renderer.hard_cases.ready import ORDINARY, Ready
from renderer.hard_cases.verdict import (
    Counts,
    judge_any,
    judge_closest,
    judge_spawned,
    overruns,
    spawn_rays,
)
from renderer.pack.nodes import PackError
from renderer.plan import PlanError
from renderer.ray_plan import Answer
from renderer.records import Flags
from renderer.variant import Variant
from scenes.scene import SceneError

REFERENCE = Variant("bvh-stack", "compute")
"""The variant whose bits, with each intersector, others are compared with."""

MOST_TESTS = 1 << 28
"""Ray-triangle tests beyond which brute force is left out."""


def measure_cell(asker: Asker, variant: Variant, ready: Ready, *, fitted: bool = False, timed: bool = True) -> Cell:
    """Ask a variant everything about a case; what cannot be built is refused with its sentence.

    `fitted` also compares the specialised text's bits, `timed` also measures the cost.
    """
    name, seed, count = ready.family.name, ready.seed, len(ready.rays)
    if variant.structure == "none" and count * len(ready.scene.faces) > MOST_TESTS:
        sentence = f"Brute force would take {count * len(ready.scene.faces):.1e} ray-triangle tests."
        return Cell(variant, name, seed, "left out", sentence, count)
    try:
        setup = asker.set_up(variant, ready)
        closest = setup.ask(ready.rays)
        occluded = setup.ask(ready.rays, any_hit=True)
    except (BuildError, PackError, PlanError, SceneError) as error:
        return Cell(variant, name, seed, "refused", str(error), count)
    counts, ulps = judge_closest(ready, variant, closest)
    counts |= judge_any(ready, variant, occluded)
    _add(counts, "cut", int(occluded.cut.sum()))
    counts["differs"] = _differing(closest, _reference(asker, variant, ready, closest))
    counts["overrun"] = sum(overruns(setup.tree, len(ready.scene.faces), answer) for answer in (closest, occluded))
    counts |= {"spawned": None, "self_hit": None, "unexpected": None}
    if ready.case.spawned is not None:
        _spawn(setup, ready, closest, counts)
    same = _same_fitted(asker, variant, ready, closest, occluded) if fitted else None
    cost = _cost(setup, ready) if timed and ready.finite else None
    return Cell(variant, name, seed, "ran", "", count, counts, ulps, cost, same)


def _reference(asker: Asker, variant: Variant, ready: Ready, mine: Answer) -> Answer | None:
    """What the reference of the variant's intersector answers; every exact walk answers the same bits."""
    known = ready.references
    if variant.intersector not in known:
        like = replace(REFERENCE, intersector=variant.intersector)
        try:
            known[variant.intersector] = mine if like == variant else asker.set_up(like, ready).ask(ready.rays)
        except (BuildError, PackError, PlanError):
            known[variant.intersector] = None
    return known[variant.intersector]


def _differing(mine: Answer, reference: Answer | None) -> int | None:
    return None if reference is None else int(_differ(mine, reference).sum())


def _differ(a: Answer, b: Answer) -> Flags:
    flags: Flags = (a.hits.primitive != b.hits.primitive) | (a.hits.t.view(np.uint32) != b.hits.t.view(np.uint32))
    return flags


def _spawn(setup: Setup, ready: Ready, closest: Answer, counts: Counts) -> None:
    index, spawned = spawn_rays(ready, closest)
    if not len(index):
        counts["spawned"] = 0
        return
    answer = setup.spawn(closest, index, spawned)
    found = judge_spawned(ready, closest.hits.primitive[index], answer)
    _add(counts, "nan", found.pop("spawned_nan") or 0)
    _add(counts, "cut", int(answer.cut.sum()))
    _add(counts, "overrun", overruns(setup.tree, len(ready.scene.faces), answer))
    counts |= found


def _add(counts: Counts, name: str, number: int) -> None:
    counts[name] = (counts.get(name) or 0) + number


def _cost(setup: Setup, ready: Ready) -> float:
    return setup.seconds_per_ray(ready.rays[slice(0, ORDINARY)]) / setup.seconds_per_ray(ready.ordinary)


def _same_fitted(asker: Asker, variant: Variant, ready: Ready, closest: Answer, occluded: Answer) -> bool:
    """Whether the specialised text, with a constant for what is asked, gives the same bits."""
    setup = asker.set_up(variant, ready, fitted=True)
    again, any_again = setup.ask(ready.rays), setup.ask(ready.rays, any_hit=True)
    return not (_differ(closest, again).any() or _differ(occluded, any_again).any())
