"""The families of hard cases are what they are said to be, and a study outlives its processes."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from renderer.build.chain import chain_bvh
from renderer.build.tree import MAX_DEPTH
from renderer.hard_cases import study
from renderer.hard_cases.cell import FAULTS, WRONG, Cell
from renderer.hard_cases.promises import broken
from renderer.hard_cases.ready import Ready
from renderer.hard_cases.study import TESTED, Order, all_variants, few_variants, run_order
from renderer.judge import referee
from renderer.records import Rays
from renderer.variant import AXES, TRAVERSALS, Variant
from scenes.hard_cases import FAMILIES
from scenes.hard_cases.case import HardCase

SEED = 3
SHARE = 0.1


def rays_of(case: HardCase) -> Rays:
    return Rays(case.origin, case.direction, case.reach)


def test_there_are_many_families_each_with_a_reason_and_a_source() -> None:
    assert len(FAMILIES) >= 25
    for family in FAMILIES.values():
        assert family.reason.endswith(".")
        assert ". " not in family.reason
        assert family.source
    told = Path("docs/hard_cases.md").read_text(encoding="utf-8")
    assert [name for name in FAMILIES if f"`{name}`" not in told] == []


@pytest.mark.parametrize("name", FAMILIES)
def test_a_case_comes_from_its_seed(name: str) -> None:
    first, again, other = (FAMILIES[name].case(seed, SHARE) for seed in (SEED, SEED, SEED + 1))
    assert len(first.origin) == len(first.direction) == len(first.reach) >= 64
    for part in ("triangles", "origin", "direction", "reach"):
        assert getattr(first, part).dtype == np.float32
        np.testing.assert_array_equal(getattr(first, part), getattr(again, part))
    # Where every number is NaN, or infinite, nothing is left to draw.
    assert name in ("nan-both", "inf-both") or any(
        not np.array_equal(getattr(first, part), getattr(other, part), equal_nan=True)
        for part in ("triangles", "origin", "direction", "reach")
    )
    assert (first.spawned is not None) == FAMILIES[name].spawns


@pytest.mark.parametrize("name", [name for name, family in FAMILIES.items() if family.case(SEED, 0.01).closed])
def test_every_ray_at_a_closed_surface_hits_it(name: str) -> None:
    """By the exact referee, over the float32 rays: so a miss is a hole."""
    case = FAMILIES[name].case(SEED, 0.01)
    assert (Ready(FAMILIES[name], SEED, 0.01).truth.primitive >= 0).all()
    assert len(case.origin) >= 64


@pytest.mark.parametrize("name", [name for name in FAMILIES if name.startswith(("nan-", "inf-", "no-direction"))])
def test_rays_that_are_none_hit_nothing(name: str) -> None:
    case = FAMILIES[name].case(SEED, SHARE)
    found = referee.closest(case.triangles, rays_of(case)).primitive
    assert (found >= 0).any() == (name == "inf-reach")


@pytest.mark.parametrize("name", ["only-degenerates", "pbrt-bad-case"])
def test_what_has_no_area_is_not_hit(name: str) -> None:
    case = FAMILIES[name].case(SEED, SHARE)
    assert (referee.closest(case.triangles, rays_of(case)).primitive == -1).all()


def test_spawned_rays_find_what_is_expected() -> None:
    """In float64, from the middle between what they left and what is next."""
    for name in ("leak", "respawn-grazing"):
        case = FAMILIES[name].case(SEED, SHARE)
        assert case.spawned is not None
        first = referee.closest(case.triangles, rays_of(case))
        assert (first.primitive >= 0).all()
        point = case.origin + first.t[:, None] * case.direction + [0.0, 0.0, 4e-4]
        leaving = Rays(point.astype(np.float32), case.spawned.direction, case.spawned.reach)
        hidden = referee.any_hit(case.triangles, leaving)
        assert (hidden == (case.spawned.expect == "blocked")).all()


def test_trees_are_as_deep_as_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("RAYFARM_CACHE", str(tmp_path))

    def depth(name: str, traversal: str) -> int:
        tree = Ready(FAMILIES[name], SEED, SHARE).tree(Variant(traversal))
        assert tree is not None
        return tree.depth

    assert depth("chain-64-leftward", "bvh-stack") == depth("chain-64-rightward", "bvh-parent-link") == MAX_DEPTH
    assert depth("all-sizes", "bvh-restart-trail") > 32
    assert depth("progression", "bvh-stack") > 20
    assert depth("progression", "kd-push-down") > 14


def test_a_chain_holds_every_triangle_once() -> None:
    triangles = FAMILIES["chain-33-leftward"].case(SEED, SHARE).triangles
    for rightward in (True, False):
        tree = chain_bvh(triangles, rightward=rightward)
        leaves = np.flatnonzero(tree.count)
        assert sorted(tree.child[leaves]) == list(range(len(triangles)))
        inner = np.flatnonzero(tree.count == 0)
        assert (tree.parent[tree.child[inner]] == inner).all()
        assert (tree.lower[tree.child[inner]] >= tree.lower[inner]).all()


def test_every_two_values_of_the_axes_meet_that_are_valid_together() -> None:
    few, every = few_variants(), all_variants()
    assert set(few) <= set(every)
    assert len(few) == len(set(few)) < len(every) / 4
    for first, second in combinations(TESTED, 2):
        met = {(getattr(variant, first), getattr(variant, second)) for variant in few}
        plain = {(getattr(variant, first), getattr(variant, second)) for variant in every if departs(variant) <= 2}
        assert met == plain
    for axis in TESTED:
        assert {getattr(variant, axis) for variant in few} == set(AXES[axis])
    assert {variant.traversal for variant in few_variants(("kd-backtrack",))} == {"kd-backtrack"}


def departs(variant: Variant) -> int:
    return sum(getattr(variant, axis) != getattr(Variant(), axis) for axis in TESTED[1:])


def row(outcome: str = "ran", family: str = "stadium", **counts: object) -> dict[str, object]:
    plain: dict[str, int | None] = dict.fromkeys((*WRONG, *FAULTS, "differs", "spawned"), 0)
    values = {key: value for key, value in counts.items() if key in Variant().as_dict()}
    cell = Cell(Variant(method="compute", **values), family, SEED, outcome, counts=plain)  # type: ignore[arg-type]
    return cell.to_json() | {key: value for key, value in counts.items() if key not in values}


def test_promises_are_kept_or_told() -> None:
    assert broken([row(), row("refused"), row("left out")]) == []
    for name in FAULTS:
        assert len(broken([row(family="garbage-finite", box="williams") | {name: 1}])) == 1
    assert len(broken([row("hung"), row("crashed")])) == 2
    assert len(broken([row(false_miss=1), row(differs=1), row(fitted=False)])) == 3
    assert broken([row(false_miss=1, box="williams"), row(hole=2), row(family="garbage-finite", false_hit=1)]) == []
    assert len(broken([row(hole=1, intersector="watertight"), row(self_hit=1, offset="bounded")])) == 2
    assert broken([row(self_hit=1)]) == []
    assert broken([row(family="far-eye", traversal="kd-push-down", differs=3)]) == []
    assert len(broken([row(family="nan-origin", cost=2.6), row(family="nan-origin", cost=2.4)])) == 1


@pytest.mark.parametrize("how", ["crashed", "hung"])
def test_a_process_that_dies_is_counted_and_followed_by_another(how: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(study, "CHILD", "dying_cells")
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    limit = 1.0 if how == "hung" else 60.0
    families = ("stadium", "leak", "limits", "flat-scene")
    variants = [Variant(name, "compute") for name in list(TRAVERSALS)[:3]]
    rows = run_order(Order(variants, families, limit_s=limit, processes=2)).rows
    assert len(rows) == len(families) * len(variants)
    lost = [row for row in rows if row["outcome"] != "ran"]
    assert {(row["outcome"], row["family"]) for row in lost} == {(how, "limits")}
    assert len(lost) == len(variants)
