"""Cells held against a baseline row: the same ratio, interval and verdict as a comparison of the two results."""

from __future__ import annotations

import random
from functools import partial
from typing import Any

import pytest

from renderer.times.interval import median
from server.comparison.differences import pair_of
from server.comparison.flat import Stored, flatten
from server.comparison.metrics import METRICS
from server.comparison.pivot import Comparison, Group, pivot, texts_of
from server.comparison.ratios import Ratio, with_ratios

ROUNDS = 8


def result(draw: random.Random, traversal: str, time: float, rays: int = 1000, **extra: Any) -> dict[str, Any]:
    frames = [time * draw.lognormvariate(0, 0.01) for _ in range(3 * ROUNDS)]
    middle = median(frames)
    return {
        "scene": "forest",
        "traversal": traversal,
        "size": [8, 8],
        "rays_kind": "both",
        "device": {"id": "llvmpipe", "driver": "Mesa"},
        "frames_ms": frames,
        "frames_by_round": [3] * ROUNDS,
        "frame_ms": {"median": middle, "ci_low": min(frames), "ci_high": max(frames)},
        "fps": 1e3 / middle,
        "mrays_per_s": rays / middle / 1e3,
        "rays_timed": rays,
        "structure_bytes": len(traversal),
        **extra,
    }


def table_of(documents: list[dict[str, Any]], metric: str, baseline: str, **axes: Any) -> Comparison:
    rows = [flatten(Stored(job, None, "", document)) for job, document in enumerate(documents, 1)]
    groups = [Group(texts_of(row), None, 1, row["job"]) for row in rows]
    chosen = (METRICS[metric], axes.get("rows", ("traversal",)), axes.get("columns", ("scene",)))
    load = partial(lambda found, ids: {id_: found[id_ - 1] for id_ in ids}, rows)
    table = pivot(groups, load, rows, *chosen, limit=axes.get("limit"), baseline=baseline)
    return with_ratios(table, dict(enumerate(documents, 1))) if table.base else table


def ratios(table: Comparison) -> dict[str, Ratio]:
    return {key[0]: cell.ratio for key, (cell,) in zip(table.row_keys, table.cells, strict=True) if cell and cell.ratio}


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("metric", ["frame_ms_median", "fps", "mrays_per_s"])
def test_a_speed_has_the_ratio_of_the_rounds_with_interval_and_verdict(metric: str, seed: int) -> None:
    draw = random.Random(seed)
    ours, theirs = result(draw, "bvh-stack", 10.0), result(draw, "kd-backtrack", 12.0)
    found = ratios(table_of([ours, theirs], metric, "bvh-stack"))
    wanted = pair_of(ours, theirs, "wall").difference
    assert wanted.low is not None
    assert wanted.high is not None
    assert found["bvh-stack"] == Ratio(1.0, verdict="baseline")
    ratio = found["kd-backtrack"]
    ends = (wanted.ratio, wanted.low, wanted.high)
    if METRICS[metric].better == "higher":
        ends = (1 / wanted.ratio, 1 / wanted.high, 1 / wanted.low)
    assert (ratio.value, ratio.low, ratio.high) == pytest.approx(ends)
    assert (ratio.verdict, ratio.note) == ("slower", "")


def test_a_speed_by_rays_counts_the_rays_of_each_side() -> None:
    """Hybrid casts no primary rays: a frame that is faster by that alone is not a faster tracer."""
    draw = random.Random(1)
    ours, theirs = result(draw, "bvh-stack", 10.0, rays=1000), result(draw, "kd-backtrack", 5.0, rays=500)
    speed, frames = (ratios(table_of([ours, theirs], m, "bvh-stack"))["kd-backtrack"] for m in ("mrays_per_s", "fps"))
    assert speed.value == pytest.approx(1, abs=0.02)
    assert speed.verdict == "no difference found"
    assert frames.value == pytest.approx(2, abs=0.04)
    assert "500 rays against 1,000" in speed.note


def test_other_figures_have_a_plain_ratio() -> None:
    draw = random.Random(1)
    found = ratios(
        table_of([result(draw, "bvh-stack", 1), result(draw, "kd-backtrack", 1)], "structure_bytes", "bvh-stack")
    )
    assert found["kd-backtrack"] == Ratio(len("kd-backtrack") / len("bvh-stack"))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"size": [16, 8]}, "another size"),
        ({"rays_kind": "primary"}, "another rays"),
        ({"scene": "bunny", "size": [4, 4]}, "another scene and size"),
        ({"mrays_per_s": None}, "not measured"),
    ],
)
def test_no_ratio_is_made_where_none_can_be_and_it_says_why(changes: dict[str, Any], words: str) -> None:
    draw = random.Random(1)
    documents = [result(draw, "bvh-stack", 1.0), result(draw, "kd-backtrack", 1.0, **changes)]
    ratio = ratios(table_of(documents, "mrays_per_s", "bvh-stack", columns=("method",)))["kd-backtrack"]
    assert ratio.value is None
    assert words in ratio.note


def test_what_must_be_known_stands_beside_a_ratio() -> None:
    draw = random.Random(1)
    times = [f"2026-01-01T00:{minute:02}" for minute in range(20)]
    ours = result(draw, "bvh-stack", 1.0, rounds_started_at=times[:8])
    there: dict[str, Any] = {"device": {"id": "llvmpipe", "driver": "Mesa 2"}, "rounds_started_at": times[10:]}
    note = ratios(table_of([ours, result(draw, "kd-backtrack", 1.0, **there)], "fps", "bvh-stack"))["kd-backtrack"].note
    assert note == "environments differ in driver; measured one after the other"


def test_results_without_frames_have_a_plain_ratio_that_says_so() -> None:
    draw = random.Random(1)
    documents = [result(draw, "bvh-stack", 1.0), result(draw, "kd-backtrack", 2.0, frames_ms=[])]
    ratio = ratios(table_of(documents, "fps", "bvh-stack"))["kd-backtrack"]
    assert (ratio.low, ratio.verdict, ratio.note) == (None, None, "no frames to compare")
    assert ratio.value == pytest.approx(0.5, abs=0.02)


def test_a_baseline_of_zero_gives_no_ratio() -> None:
    draw = random.Random(1)
    documents = [result(draw, name, 1.0, build_ms=ms) for name, ms in (("bvh-stack", 0.0), ("kd-backtrack", 3.0))]
    ratio = ratios(table_of(documents, "build_ms", "bvh-stack"))["kd-backtrack"]
    assert (ratio.value, ratio.note) == (None, "no ratio: the baseline is 0")


def test_the_baseline_may_be_a_row_that_is_not_shown_and_one_that_is_not_there_is_told() -> None:
    draw = random.Random(1)
    documents = [result(draw, name, time) for name, time in (("bvh-stack", 1.0), ("kd-backtrack", 2.0))]
    table = table_of(documents, "fps", "kd-backtrack", limit=1)
    assert [key[0] for key in table.row_keys] == ["bvh-stack"]
    assert ratios(table)["bvh-stack"].verdict == "faster"
    missing = table_of(documents, "fps", "nothing")
    assert missing.base == []
    assert "no row 'nothing'" in missing.notes[0]
