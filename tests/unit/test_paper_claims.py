"""Every claim of the paper comes out all three ways when that is what was planted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from paper_documents import PAIRS, SCENES, Factor, World

from server.paper.claims import CLAIMS
from server.paper.data import COSTS, TRAVERSALS, Cell, sections
from server.paper.verdict import OUTCOMES, Outcome, Verdict

Worlds = tuple[World, World, World]

TRAIL, LINK, PUSH, BACK = "bvh-restart-trail", "bvh-parent-link", "kd-push-down", "kd-backtrack"
FEW = "cornell-box"


def by(field: str, **factors: float) -> Factor:
    """Factors by the value of one field, 1 where none is given."""
    named = {name.replace("_", "-"): factor for name, factor in factors.items()}
    return lambda cell: named.get(getattr(cell, field), 1.0)


def times(*factors: Factor) -> Factor:
    def product(cell: Cell) -> float:
        value = 1.0
        for factor in factors:
            value *= factor(cell)
        return value

    return product


def where(condition: Callable[[Cell], bool], factor: Factor) -> Factor:
    return lambda cell: factor(cell) if condition(cell) else 1.0


def walks(**factors: float) -> Factor:
    short = {"trail": TRAIL, "link": LINK, "push": PUSH, "back": BACK}
    return by("traversal", **{short[name].replace("-", "_"): factor for name, factor in factors.items()})


def costs(*factors: float) -> Factor:
    """Factors by SAH costs, in PAIRS' order."""
    named = dict(zip(PAIRS, factors, strict=True))
    return lambda cell: named[cell.sah]


def is_few(cell: Cell) -> bool:
    return cell.scene == FEW


def is_complex(cell: Cell) -> bool:
    return cell.scene != FEW


def is_forest(cell: Cell) -> bool:
    return cell.scene == "forest"


def timed(holds: Factor, fails: Factor, swings: Callable[[Cell], bool] = lambda _: True) -> Worlds:
    """Undecided where rounds differ by far more than the sides."""
    return World(time=holds), World(time=fails), World(time=holds, rounds=4, swings=swings)


def counts(name: str, holds: Factor, fails: Factor) -> Worlds:
    """Undecided where the forest disagrees with the other scenes."""
    mixed = times(where(is_forest, fails), where(lambda cell: not is_forest(cell), holds))
    return tuple(World(**{name: factor}) for factor in (holds, fails, mixed))  # type: ignore[return-value, arg-type]


def spread(cell: Cell) -> float:
    """A figure that differs for every variant of a scene."""
    order = [TRAVERSALS.index(cell.traversal), PAIRS.index(cell.sah), len(cell.layout), len(cell.method)]
    return 1 + sum(place * step for place, step in zip(order, (1.0, 0.31, 0.017, 0.0013), strict=True))


def against(factor: Factor) -> Factor:
    return lambda cell: 1 / factor(cell)


def predicted(name: str) -> Worlds:
    """Times that rise with the figure, fall with it, and have little to do with it."""
    loose: Factor = lambda cell: 1 + (7 * spread(cell)) % 1 + 0.25 * spread(cell)  # noqa: E731
    return (
        World(time=spread, **{name: spread}),  # type: ignore[arg-type]
        World(time=against(spread), **{name: spread}),  # type: ignore[arg-type]
        World(time=loose, **{name: spread}),  # type: ignore[arg-type]
    )


PLANTED: dict[str, Callable[[], Worlds]] = {
    "hybrid-beats-fragment": lambda: timed(by("method", hybrid=0.8), by("method", hybrid=1.2)),
    "hybrid-beats-compute": lambda: timed(by("method", hybrid=0.8), by("method", hybrid=1.2)),
    "fragment-compute-equal": lambda: timed(by("method", compute=1.02), by("method", compute=1.3)),
    "hybrid-best": lambda: timed(by("method", hybrid=0.8), by("method", compute=0.8)),
    "compact-not-always": lambda: timed(
        where(lambda cell: cell.scene == FEW and cell.traversal == PUSH, by("layout", compact=1.1)),
        by("layout", compact=0.9),
    ),
    "split-everywhere": lambda: timed(
        by("layout", split=0.95),
        where(lambda cell: cell.scene == FEW and cell.traversal == PUSH, by("layout", split=1.3)),
    ),
    "layout-on-complex": lambda: timed(
        where(is_complex, by("layout", split=0.7)),
        where(is_few, by("layout", split=0.7)),
        lambda cell: cell.layout == "split",
    ),
    "compact-smaller": lambda: counts("primitive_bytes", by("layout", compact=0.8), by("layout", compact=1.2)),
    "compact-saves": lambda: counts("lines", by("layout", compact=0.8), by("layout", compact=1.2)),
    "split-saves": lambda: counts("lines", by("layout", split=0.8), by("layout", split=1.2)),
    "split-saves-most": lambda: counts("lines", by("layout", split=0.8), by("layout", compact=0.8)),
    "compact-alu": lambda: counts("alu", by("layout", compact=1.1), by("layout", compact=0.9)),
    "complex-more-accesses": lambda: counts("lines", where(is_complex, lambda _: 3), where(is_complex, lambda _: 0.3)),
    "complex-more-primitives": lambda: counts(
        "triangles", where(is_complex, lambda _: 3), where(is_complex, lambda _: 0.3)
    ),
    "push-down-excels": lambda: timed(where(is_few, walks(push=0.7)), where(is_few, walks(push=1.4))),
    "push-down-deteriorates": lambda: timed(
        where(is_complex, walks(push=1.5)), where(is_few, walks(push=1.5)), lambda cell: cell.traversal == PUSH
    ),
    "trail-best-complex": lambda: timed(where(is_complex, walks(trail=0.7)), where(is_complex, walks(link=0.7))),
    "trail-best": lambda: timed(walks(trail=0.7), walks(push=0.7)),
    "backtrack-parent-link-equal": lambda: timed(walks(back=1.03), walks(back=0.7)),
    "push-down-worst": lambda: timed(walks(push=1.4), walks(back=1.4)),
    "nodes-predict": lambda: predicted("nodes"),
    "nodes-strongest": lambda: (
        World(time=spread, nodes=spread, alu=against(spread), lines=against(spread)),
        World(time=spread, nodes=against(spread), alu=spread, lines=spread),
        World(time=spread, nodes=spread, alu=spread, lines=spread),
    ),
    "push-down-most-nodes": lambda: counts("nodes", walks(push=1.4), walks(push=0.8)),
    "kd-more-memory": lambda: counts("lines", walks(push=1.2, back=1.4), walks(push=0.8, back=1.4)),
    "memory-predicts": lambda: predicted("lines"),
    "backtrack-fewest-alu": lambda: counts("alu", walks(back=0.8), walks(link=0.8)),
    "push-down-most-alu": lambda: counts("alu", walks(push=1.4), walks(trail=1.4)),
    "alu-predicts": lambda: predicted("alu"),
    "backtrack-excepted": lambda: timed(walks(back=1.3), walks(trail=1.3)),
    "intersection-below": lambda: timed(costs(1.3, 1.1, 1.0, 1.1), costs(0.8, 1.1, 1.0, 1.1)),
    "slightly-below": lambda: timed(costs(1.3, 0.8, 1.0, 1.1), costs(1.3, 1.1, 1.0, 1.1)),
    "settled-costs": lambda: timed(costs(1.3, 1.2, 1.0, 1.2), costs(1.3, 0.8, 1.0, 1.1)),
    "shallow-best": lambda: (
        World(time=costs(1.6, 1.3, 1.0, 0.8), depth=costs(1.6, 1.3, 1.0, 0.8)),
        World(time=costs(1.6, 1.3, 1.0, 0.8), depth=costs(0.8, 1.0, 1.3, 1.6)),
        World(time=costs(1.6, 1.3, 1.0, 0.8), depth=times(where(is_forest, costs(1.6, 1.3, 1.0, 0.8)),
              where(lambda cell: not is_forest(cell), costs(1.0, 1.6, 0.8, 1.3)))),
    ),
    "cheap-traversal-more-nodes": lambda: counts("nodes", costs(1.6, 1.3, 1.0, 0.8), costs(0.8, 1.0, 1.3, 1.6)),
    "sah-nodes-predict": lambda: (
        World(time=costs(1.6, 1.3, 1.0, 0.8), nodes=costs(1.6, 1.3, 1.0, 0.8)),
        World(time=costs(1.6, 1.3, 1.0, 0.8), nodes=costs(0.8, 1.0, 1.3, 1.6)),
        World(time=costs(1.6, 1.3, 1.0, 0.8), nodes=times(where(is_forest, costs(1.6, 1.3, 1.0, 0.8)),
              where(lambda cell: not is_forest(cell), costs(1.0, 1.6, 0.8, 1.3)))),
    ),
}  # fmt: skip


def verdict_of(world: World, key: str) -> Verdict:
    [section] = sections(world.documents())
    claim = next(claim for claim in CLAIMS if claim.key == key)
    return Verdict(claim, section, claim.rule.judge(section))


def test_every_claim_is_planted() -> None:
    assert list(PLANTED) == [claim.key for claim in CLAIMS]


@pytest.mark.parametrize(("clock", "seed"), [("cpu", 1), ("wall", 2)])
@pytest.mark.parametrize(("planted", "outcome"), list(enumerate(OUTCOMES)), ids=lambda value: str(value))
@pytest.mark.parametrize("key", list(PLANTED))
def test_a_claim_comes_out_as_planted(key: str, planted: int, outcome: Outcome, clock: str, seed: int) -> None:
    world = replace(PLANTED[key]()[planted], clock=clock, seed=seed)
    verdict = verdict_of(world, key)
    assert verdict.outcome == outcome, verdict.finding
    assert verdict.finding.value is not None
    assert verdict.finding.parts


@pytest.mark.parametrize("key", list(PLANTED))
def test_without_what_it_needs_a_claim_is_undecided_and_says_why(key: str) -> None:
    def bare(cell: Cell, document: dict[str, Any]) -> dict[str, Any]:
        return document | {
            "frames_ms": [],
            "frames_cpu_ms": [],
            "per_ray": None,
            "model": None,
            "primitive_bytes": None,
        }

    verdict = verdict_of(replace(PLANTED[key]()[0], change=bare), key)
    assert verdict.outcome == "undecided"
    assert verdict.finding.reason.endswith(".")


@pytest.mark.parametrize("key", [key for key in PLANTED if PLANTED[key]()[2].rounds == 4])
def test_three_rounds_decide_no_claim_about_time(key: str) -> None:
    for world in PLANTED[key]()[:2]:
        verdict = verdict_of(replace(world, rounds=3), key)
        assert verdict.outcome == "undecided"
        assert "3 rounds" in verdict.finding.reason


def test_four_rounds_suffice() -> None:
    """So many has the study: planted differences are found in both directions."""
    for key, make in PLANTED.items():
        for world, outcome in zip(make()[:2], OUTCOMES, strict=False):
            assert verdict_of(replace(world, rounds=4), key).outcome == outcome, key


def test_the_scenes_are_few_and_complex() -> None:
    assert {name: count > 1000 for name, count in SCENES.items()} == {name: name != FEW for name in SCENES}
    assert COSTS in PAIRS
