"""Studies of hard cases as documents: checked, stored on both databases, laid out and compared."""

from __future__ import annotations

import copy
import json
import math
import threading
from typing import Any

import pytest
from hard_case_documents import DEVICE, FAMILIES, PLAIN, VARIANTS, study
from pydantic import ValidationError

from renderer.hard_cases.promises import PROMISES
from renderer.variant import AXES
from scenes.hard_cases import FAMILIES as ALL_FAMILIES
from server.hard_cases.changes import find_changes
from server.hard_cases.document import Document
from server.hard_cases.export import cell_rows, columns_of
from server.hard_cases.matrix import HardCaseError, axes_of, kind_of, make_matrix, read_view
from server.hard_cases.report import render_report
from server.hard_cases.store import find_run, keep_run, list_runs
from server.problems import Problem
from server.store.database import Database

Json = dict[str, Any]


def read(document: Json) -> Document:
    return Document.model_validate_json(json.dumps(document))


def test_a_document_tells_every_promise_and_every_cell() -> None:
    document = study(changed={"stadium": {"nan": 3}, "nan-origin": {"cost": 2.6}})
    promises = {one["name"]: one for one in document["promises"]}
    assert list(promises) == [promise.name for promise in PROMISES]
    assert (promises["answers"]["broken"], promises["cost"]["broken"]) == (1, 1)
    assert [one["name"] for one in document["promises"] if one["broken"]] == ["answers", "cost"]
    assert promises["offset"]["cells"] == 1
    assert len(document["broken"]) == 2
    assert sum(len(cell["broken"]) for cell in document["cells"]) == 2
    assert document["device"] == DEVICE
    assert len(document["versions"]["shader_sha"]) == 64
    kept = json.loads(read(document).model_dump_json())
    assert kept == document | {"started_at": "2026-01-02T03:04:00Z"}


def test_numbers_that_json_lacks_become_null() -> None:
    document = study(changed={"stadium": {"t_ulp_max": math.inf}})
    assert next(c["t_ulp_max"] for c in document["cells"] if c["family"] == "stadium") is None


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        (("study",), "paper", "hard-cases"),
        (("cells", 0, "family"), "nowhere", "families does not list"),
        (("cells", 0, "hole"), -1, "greater than or equal to 0"),
        (("cells", 0, "outcome"), "vanished", "crashed"),
        (("cells", 1, "variant"), {"traversal": "a"}, "other axes"),
        (("cells",), [], "at least 1"),
        (("surprise",), 1, "not permitted"),
    ],
)
def test_what_is_no_study_is_refused(path: tuple[str | int, ...], value: object, words: str) -> None:
    document: Any = study()
    place = document
    for step in path[:-1]:
        place = place[step]
    place[path[-1]] = value
    with pytest.raises(ValidationError, match=words):
        read(document)


def test_values_and_counts_of_other_versions_are_taken() -> None:
    document = study()
    for cell in document["cells"]:
        cell["variant"]["nodes"] = "grid9"
        cell["conservative"] = 4
    kept = read(document).model_dump(mode="json")
    [row] = [row for row in make_matrix(kept, read_view(axes_of(kept["cells"]), ())).rows if row.name == "stadium"]
    assert "4 conservative" in row.cells[0].detail


def test_the_table_merges_what_its_columns_do_not_tell_apart() -> None:
    document = study()
    axes = axes_of(document["cells"])
    assert list(axes) == ["traversal", "intersector", "box", "offset"]
    merged = make_matrix(document, read_view(axes, ()))
    assert merged.heads[0] == ("moller-trumbore", "widened", "constant")
    rows = {row.name: row for row in merged.rows}
    assert list(rows) == list(FAMILIES)
    vertices = rows["pbrt-vertices"].cells
    assert vertices[0].lines == ["630–636 holes"]
    assert [cell.kind for cell in vertices] == ["lost", "absent", "lost", "right"]
    assert vertices[0].detail == ["1,057 edge", "t 3,282 ulp", "cost 1.25×"]
    assert vertices[0].of == 2
    assert rows["garbage-bits"].cells[0].kind == "refused"
    by_walk = make_matrix(document, read_view(axes, [("cols", "traversal"), ("intersector", "moller-trumbore")]))
    assert by_walk.heads == [("bvh-stack",), ("kd-backtrack",)]
    losses = make_matrix(document, read_view(axes, [("show", "losses"), ("intersector", "watertight")]))
    assert [row.name for row in losses.rows] == ["reintersect"]
    assert make_matrix(document, read_view(axes, ()), most=2).notes


def test_a_broken_promise_is_the_worst_of_a_cell() -> None:
    cells = study(changed={"stadium": {"nan": 3}, "pbrt-vertices": {"outcome": "hung"}})["cells"]
    mine = {cell["family"]: kind_of([cell]) for cell in cells if cell["variant"] == PLAIN.as_dict()}
    assert mine == {
        "nan-origin": "right",
        "pbrt-vertices": "broken",
        "reintersect": "lost",
        "stadium": "broken",
        "garbage-bits": "refused",
    }


@pytest.mark.parametrize(
    ("asked", "words"),
    [("cols", "Unknown columns 'x'"), ("show", "Unknown rows"), ("sort", "Unknown parameter 'sort'")],
)
def test_a_wrong_view_says_so(asked: str, words: str) -> None:
    with pytest.raises(HardCaseError, match=words):
        read_view(axes_of(study()["cells"]), [(asked, "x")])


def test_two_studies_are_compared_cell_by_cell() -> None:
    before = study()
    after = study(6, changed={"stadium": {"nan": 3}, "reintersect": {"self_hit": 4}, "nan-origin": {"cost": 2.5}})
    after["cells"] = [cell for cell in after["cells"] if cell["variant"]["box"] != "williams"]
    found = find_changes(before, after)
    assert [(c.family, c.verdict, c.what) for c in found.cells] == [
        ("stadium", "worse", ["NaN 0 → 3"]),
        ("reintersect", "other", ["self-hits 12 → 4"]),
    ]
    assert len(found.only_baseline) == 5
    assert found.only_against == []
    assert found.environment == [("seed", "5", "6")]
    assert found.cost_ratio == 1.0
    assert [c.verdict for c in find_changes(after, before).cells] == ["better", "other"]


def test_cells_as_rows_have_every_axis_and_count() -> None:
    document = study()
    rows = list(cell_rows(document))
    assert len(rows) == len(document["cells"])
    assert {*AXES, "hole", "overrun", "t_ulp_max", "cost", "sentence"} <= set(columns_of(document))
    assert rows[0]["family"] == "nan-origin"
    assert rows[0]["traversal"] == VARIANTS[0].traversal


def test_a_report_stands_alone() -> None:
    document = study(changed={"stadium": {"nan": 3}})
    document["families"][0]["reason"] = "<script>alert(1)</script>"
    text = render_report(document)
    assert "<script" not in text
    assert "http" not in text
    assert "src=" not in text
    assert "bvh-stack compute normal on stadium: 3 nan" in text
    assert all(name in text for name in FAMILIES)


def test_runs_are_kept_once_with_their_environment(database_url: str) -> None:
    database = Database(database_url)
    first, new = keep_run(database, read(study()))
    again, second_new = keep_run(database, read(copy.deepcopy(study())))
    other, _ = keep_run(database, read(study(6)))
    assert (new, second_new) == (True, False)
    assert first == again
    with database.reading() as session:
        runs = list_runs(session, 10)
        assert [run["id"] for run in runs] == [other["id"], first["id"]]
        assert [run["seed"] for run in runs] == [6, 5]
        assert runs[0]["device"] == DEVICE
        assert runs[0]["outcomes"] == {"ran": 17, "refused": 4}
        assert (runs[0]["variants"], runs[0]["families"], runs[0]["broken"]) == (5, 5, 0)
        assert find_run(session, str(first["id"])).document["cells"] == study()["cells"]
        for wrong in ("99", "x", "²", "9" * 30, "-1"):
            with pytest.raises(Problem, match="no hard-case run"):
                find_run(session, wrong)
    database.close()


def test_one_study_that_comes_several_times_at_once_is_one_run(database_url: str) -> None:
    database = Database(database_url)
    document, lines = read(study()), []
    threads = [threading.Thread(target=lambda: lines.append(keep_run(database, document))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len({line["id"] for line, _ in lines}) == 1
    assert [new for _, new in lines].count(True) == 1
    database.close()


def test_families_of_the_documents_exist() -> None:
    assert set(FAMILIES) <= set(ALL_FAMILIES)
