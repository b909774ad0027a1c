"""Pivoting results: no averages, honest notes, stable order."""

from __future__ import annotations

import random
from typing import Any

import pytest

from server.comparison.flat import COLUMNS, Stored, flatten, to_csv, to_frame
from server.comparison.metrics import METRICS
from server.comparison.pivot import CompareError, compare, read_dimensions
from server.dashboard.cells import view_cells

SPEED = METRICS["mrays_per_s"]


def stored(job: int, traversal: str, scene: str, speed: float | None, **extra: Any) -> Stored:
    document = {"scene": scene, "traversal": traversal, "mrays_per_s": speed, "size": [8, 8], **extra}
    return Stored(job, None, f"2026-01-01T00:00:{job:02d}", document)


def test_the_latest_of_a_cell_is_shown_and_the_rest_counted() -> None:
    old, new = stored(1, "bvh-stack", "a", 1.0), stored(2, "bvh-stack", "a", 3.0, size=[16, 16])
    table = compare([new, old], SPEED)
    cell = table.cells[0][0]
    assert cell is not None
    assert (cell.figures["mrays_per_s"].value, cell.count, cell.differs) == (3.0, 2, ("size",))
    assert len(table.notes) == 1


def test_repeated_measurements_alone_need_no_note() -> None:
    table = compare([stored(2, "bvh-stack", "a", 3.0), stored(1, "bvh-stack", "a", 1.0)], SPEED)
    assert table.notes == []


def test_versions_are_named_where_nothing_else_differs() -> None:
    first, second = ({"versions": {"shader_sha": sha}} for sha in "ab")
    table = compare([stored(2, "bvh-stack", "a", 3.0, **first), stored(1, "bvh-stack", "a", 1.0, **second)], SPEED)
    assert "versions_shader_sha" in table.notes[0]


@pytest.mark.parametrize("seed", range(5))
def test_the_order_does_not_depend_on_when_results_came(seed: int) -> None:
    pairs = [(t, s) for t in ("kd-backtrack", "bvh-stack", "zebra", "brute-force") for s in ("b", "a", "c")]
    results = [stored(i, t, s, float(i)) for i, (t, s) in enumerate(pairs)]
    random.Random(seed).shuffle(results)
    table = compare(results, SPEED)
    assert table.row_keys == [("brute-force",), ("bvh-stack",), ("kd-backtrack",), ("zebra",)]
    assert table.column_keys == [("a",), ("b",), ("c",)]


def test_what_was_not_measured_sorts_last_either_way() -> None:
    results = [
        stored(1, "bvh-stack", "a", None),
        stored(2, "kd-backtrack", "a", 2.0),
        stored(3, "brute-force", "a", 1.0),
    ]
    assert compare(results, SPEED, sort="a").row_keys[-1] == ("bvh-stack",)
    assert compare(results, SPEED, sort="-a").row_keys[-1] == ("bvh-stack",)
    assert compare(results, SPEED, sort="a").row_keys[0] == ("kd-backtrack",)


def test_a_tie_has_no_best() -> None:
    results = [
        stored(1, "bvh-stack", "a", 2.0),
        stored(2, "kd-backtrack", "a", 2.0),
        stored(3, "brute-force", "a", 1.0),
    ]
    cells = view_cells(compare(results, SPEED))
    assert [cell.best for line in cells for cell in line if cell] == [False, False, False]


@pytest.mark.parametrize(("width", "clear"), [(0.1, True), (0.6, False)])
def test_the_best_is_clear_only_where_intervals_part(width: float, clear: bool) -> None:
    frame = {"frame_ms": {"median": 1.0, "ci_low": 1 - width, "ci_high": 1 + width}}
    results = [stored(1, "bvh-stack", "a", 2.0, **frame), stored(2, "kd-backtrack", "a", 1.0, **frame)]
    cells = view_cells(compare(results, SPEED))
    assert [(cell.best, cell.clear) for line in cells for cell in line if cell] == [(True, clear), (False, clear)]


def test_missing_cells_are_empty_and_missing_figures_are_not_zero() -> None:
    table = compare([stored(1, "bvh-stack", "a", 2.0), stored(2, "kd-backtrack", "b", None)], SPEED)
    assert [[cell is None for cell in line] for line in table.cells] == [[False, True], [True, False]]
    views = view_cells(table)
    assert views[1][1] is not None
    assert (views[1][1].value, views[1][1].bar) == ("not measured", None)
    assert table.pivot().isna().to_numpy().tolist() == [[False, True], [True, True]]


def test_a_flat_row_keeps_every_level_and_nulls_objects() -> None:
    row = flatten(stored(1, "bvh-stack", "a", 1.0, vs_embree=None, device={"id": "x", "gl": {"vendor": "v"}}, list=[1]))
    assert (row["size"], row["device_id"], row["device_gl_vendor"], row["list"]) == ("8x8", "x", "v", "[1]")
    assert "vs_embree" not in row
    frame = to_frame([row])
    assert list(frame.columns[: len(COLUMNS)]) == list(COLUMNS)
    assert frame["vs_embree_ratio"].isna().all()


@pytest.mark.parametrize("name", ["=1+1", "+1", "-1", "@SUM(A1)", "\t=1", "\r=1"])
def test_csv_holds_no_formula(name: str) -> None:
    table = compare([stored(1, name, "a", -1.5, device={"name": name})], SPEED)
    text = to_csv(table.frame(), index=False)
    assert f"'{name}" in text
    assert ",-1.5," in text
    assert f"'{name}" in to_csv(table.pivot(), index=True)


@pytest.mark.parametrize("text", ["colour", "traversal,colour", "", " , "])
def test_unknown_dimensions_are_refused(text: str) -> None:
    with pytest.raises(CompareError, match="choose from traversal"):
        read_dimensions("rows", text)
