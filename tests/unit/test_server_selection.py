"""The comparison that the database makes is the one that is made of all documents in memory."""

from __future__ import annotations

import csv
import random
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

import pytest
from alembic import command
from alembic.config import Config
from sqlalchemy import func, select, text
from sqlalchemy.orm import Session
from starlette.datastructures import QueryParams

from renderer.request import Request
from renderer.variant import Variant
from server.comparison import selection
from server.comparison.differences import setup_of
from server.comparison.flat import COLUMNS, Stored, csv_lines, flatten
from server.comparison.pivot import Comparison, compare
from server.comparison.selection import known_values, load_comparison, load_rows, read_selection
from server.store.database import MIGRATIONS, Database
from server.store.engines import make_engine, writing_engine
from server.store.models import Job, Result, Setup
from server.store.records import Order, add_jobs, add_result, add_study
from server.store.setups import digest_of, facts_of

FreshDatabase = Callable[..., AbstractContextManager[str]]

COUNT = 150
QUERIES = (
    "",
    "study=2",
    "scene=forest&layout=compact&rows=method",
    "device=llvmpipe&rows=traversal,size&cols=scene,layout",
    "rows=study,layout&cols=device",
    "sort=-forest&metric=per_ray_nodes",
    "sort=forest&cols=scene&rows=traversal,method",
    "rows=family&cols=rays",
    "scene=bunny",
    "rows=sah,specialise&cols=size,rays",
    "sah=3,1.5&sah=1,2&specialise=on&rows=traversal,sah",
    "specialise=off&size=8x8&rays=both&rows=specialise",
    "sah=None,None",
)


def made(draw: random.Random) -> dict[str, Any]:
    """A result; few values on each axis, so that cells hold several that differ in different ways."""
    pick = draw.choice
    variant = Variant(pick(("bvh-stack", "kd-backtrack")), pick(("fragment", "compute")), pick(("normal", "compact")))
    device = pick(("llvmpipe", "1A2B3C4D5E"))
    found = {
        "scene": pick(("forest", "cornell-box")),
        "family": None,
        "device": {"id": device, "name": pick((f"the {device}", None)), "driver": "Mesa", "threads": 1},
        **variant.as_dict(),
        "sah": pick(({"traversal": 3.0, "intersection": 1.5}, {"traversal": 1.0, "intersection": 2.0}, None)),
        "size": pick(([8, 8], [16, 8])),
        "rays_kind": "both",
        "frame_ms": {"median": 20.0, "ci_low": 18.0, "ci_high": 22.0},
        "frames_ms": [19.0, 20.0, 21.0],
        "mrays_per_s": draw.random(),
        "per_ray": {"nodes": draw.random(), "lines": None},
        "error": {"false_hit": 0.0, "false_miss": draw.random(), "wrong_primitive": 0.0},
        "specialised": pick((["normals"], [], None)),
        "versions": {"rayfarm": pick(("0.1.0", "0.2.0")), "shader_sha": "ab" * 8, "plan": 1},
    }
    return found | ({"vs_embree": None, "a field of its own": [1, 2]} if draw.random() < 0.1 else {})


def add(session: Session, draw: random.Random, studies: list[int | None]) -> Stored:
    """One job with its result."""
    found = made(draw)
    study = draw.choice(studies)
    [part] = add_jobs(session, [Order(Request(found["scene"], Variant(), rounds=1))], study_id=study)
    result = add_result(session, part.job, found)
    session.flush()
    return Stored(part.job.id, study, result.recorded_at.isoformat(), found)


@pytest.fixture(scope="module", params=[1, 2, 3])
def filled(
    request: pytest.FixtureRequest, database_kind: str, fresh_database: FreshDatabase
) -> Iterator[tuple[Database, list[Stored]]]:
    """A database with results, and these, the newest first; for tests that read."""
    with fresh_database(database_kind) as url, holding(url, request.param) as held:
        yield held


@contextmanager
def holding(url: str, seed: int) -> Iterator[tuple[Database, list[Stored]]]:
    """Results of a seed put into an empty database, the newest first."""
    draw = random.Random(seed)
    database = Database(url)
    with database.writing() as session:
        studies = [None, *(add_study(session, name, {}, []).id for name in "ab")]
        stored = [add(session, draw, studies) for _ in range(COUNT)]
    yield database, stored[::-1]
    database.close()


def expected(stored: list[Stored], query: str) -> Comparison:
    """The comparison of those that a query string selects, all documents in hand."""
    asked = read_selection(QueryParams(query))

    def fits(one: Stored) -> bool:
        values = one.document | setup_of(one.document)
        fitting = all(values[name] in chosen for name, chosen in asked.filters.items())
        return fitting and asked.study in (None, one.study)

    return compare([one for one in stored if fits(one)], asked.metric, asked.rows, asked.columns, asked.sort)


@pytest.mark.parametrize("query", QUERIES)
def test_the_store_gives_the_table_of_all_documents(filled: tuple[Database, list[Stored]], query: str) -> None:
    database, stored = filled
    table, wanted = load_comparison(database, read_selection(QueryParams(query))), expected(stored, query)
    assert (table.row_keys, table.column_keys, table.notes) == (wanted.row_keys, wanted.column_keys, wanted.notes)
    assert table.cells == wanted.cells
    assert table.environments == wanted.environments
    assert (len(table.flat), list(table.flat)) == (len(wanted.flat), list(wanted.flat))


def test_what_is_added_later_is_there(database_url: str) -> None:
    with holding(database_url, 1) as (database, stored):
        asked = read_selection(QueryParams("rows=scene&cols=device"))
        before = load_comparison(database, asked)
        assert "bunny" not in known_values(database)["scene"]
        with database.writing() as session:
            [part] = add_jobs(session, [Order(Request("bunny", Variant(), rounds=1))])
            add_result(session, part.job, stored[0].document | {"scene": "bunny"})
        after = load_comparison(database, asked)
        assert ("bunny",) not in before.row_keys
        assert ("bunny",) in after.row_keys
        assert len(after.flat) == len(before.flat) + 1 == COUNT + 1
        assert known_values(database)["scene"] == ["bunny", "cornell-box", "forest"]


def test_results_share_their_set_ups(filled: tuple[Database, list[Stored]]) -> None:
    database, stored = filled
    different = {digest_of(facts_of(one.document)) for one in stored}
    with database.reading() as session:
        assert session.scalar(select(func.count()).select_from(Setup)) == len(different) < COUNT
        assert set(session.scalars(select(Setup.digest))) == different


def test_a_table_with_too_many_cells_says_what_it_leaves_out(filled: tuple[Database, list[Stored]]) -> None:
    database, _ = filled
    asked = read_selection(QueryParams("rows=traversal,method,layout&cols=scene,device"))
    whole, part = load_comparison(database, asked, None), load_comparison(database, asked, 9)
    assert (len(whole.row_keys), len(whole.column_keys)) == (8, 4)
    assert (part.row_keys, part.column_keys) == (whole.row_keys[:2], whole.column_keys)
    assert part.cells == whole.cells[:2]
    assert part.notes[0].startswith("The table has 8 rows and 4 columns: the first 2 rows and 4 columns are shown.")
    assert part.notes[1:] == whole.notes
    narrow = load_comparison(database, asked, 3)
    assert (len(narrow.row_keys), len(narrow.column_keys)) == (1, 3)


def test_of_many_studies_the_newest_are_compared(
    filled: tuple[Database, list[Stored]], monkeypatch: pytest.MonkeyPatch
) -> None:
    database, stored = filled
    monkeypatch.setattr(selection, "MAX_STUDIES", 1)
    asked = read_selection(QueryParams("rows=study&cols=scene&layout=normal"))
    table = load_comparison(database, asked)
    assert table.row_keys == [("2",), ("None",)]
    assert table.notes[0] == "Only the newest 1 studies are looked at: filter to reach older ones."
    kept = [one for one in stored if one.study != 1 and one.document["layout"] == "normal"]
    assert list(table.flat) == [flatten(one) for one in kept]
    assert load_comparison(database, asked, None).row_keys == [("1",), ("2",), ("None",)]


def test_the_csv_has_every_result_and_every_field(filled: tuple[Database, list[Stored]]) -> None:
    database, stored = filled
    rows = load_rows(database, read_selection(QueryParams("scene=forest")))
    lines = list(csv.DictReader("".join(csv_lines(rows, rows.fields)).splitlines()))
    wanted = [flatten(one) for one in stored if one.document["scene"] == "forest"]
    assert [line["job"] for line in lines] == [str(row["job"]) for row in wanted]
    for line, row in zip(lines, wanted, strict=True):
        assert {name: value for name, value in line.items() if value} == {
            name: str(value) for name, value in row.items() if value not in (None, "")
        }
        assert {*COLUMNS, *row} <= {*line}


def test_a_migration_gives_old_results_their_set_ups_and_studies(database_url: str) -> None:
    draw = random.Random(4)
    database = Database(database_url)
    with database.writing() as session:
        study = add_study(session, "old", {}, []).id
        stored = [add(session, draw, [None, study]) for _ in range(30)]
        before = session.execute(select(Result.id, Result.study_id, Setup.digest).join(Setup)).all()
    database.close()
    engine = make_engine(database_url)
    with writing_engine(engine).begin() as connection:
        config = Config()
        config.set_main_option("script_location", str(MIGRATIONS))
        config.attributes["connection"] = connection
        command.downgrade(config, "0004")
        assert connection.execute(text("SELECT count(*) FROM results")).scalar() == len(stored)
    engine.dispose()
    database = Database(database_url)
    with database.writing() as session:
        after = session.execute(select(Result.id, Result.study_id, Setup.digest).join(Setup)).all()
        assert sorted(after) == sorted(before)
        assert session.scalar(select(func.count()).select_from(Job)) == len(stored)
        add(session, draw, [study])  # New set-ups get ids of their own.
    database.close()
