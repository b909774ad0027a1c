"""The report: one page with nine figures, every claim, no address of another place, hostile names as text."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from paper_documents import SCENES, World, with_pictures

from renderer.times.difference import by_round, difference
from renderer.times.interval import median
from server.paper.claims import CLAIMS
from server.paper.data import Cell, sections
from server.paper.errors import PaperError
from server.paper.figures import figures
from server.paper.judging import claims_view, judge
from server.paper.measures import ALU, MEMORY, TRAFFIC, choose
from server.paper.report import Links, pictures_in, render_report, write_report

Json = dict[str, Any]
HOSTILE = "<script>alert(1)</script> & \"quoted\" $x^2$ 'names' \u202e"


class Page(HTMLParser):
    """The elements of a page: their names, ids, and where they point."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.ids: list[str] = []
        self.addresses: list[str] = []
        self.unnamed: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.tags.append(tag)
        self.ids += [name for name in [given.get("id")] if name]
        self.addresses += [given[name] or "" for name in ("href", "src", "xlink:href") if name in given]
        if tag == "img" and not given.get("alt"):
            self.unnamed.append(tag)
        if tag == "svg" and not (given.get("aria-label") and given.get("role") == "img"):
            self.unnamed.append(tag)


def nothing(_: str) -> bytes | None:
    return None


@pytest.fixture(scope="module")
def text(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("pictures")
    path = folder / "report.html"
    write_report(World(change=with_pictures(folder)).documents(), pictures_in(folder), path)
    return path.read_text(encoding="utf-8")


def test_the_page_needs_nothing_else(text: str) -> None:
    page = Page(text)
    assert not {"script", "iframe", "object", "base"} & set(page.tags)
    outside = [address for address in page.addresses if not address.startswith(("#", "data:"))]
    assert outside == []
    assert re.findall(r"url\((?!#)|@import|https?://", text.replace("http://www.w3.org/1999/xlink", "")) == []


def test_ids_are_unique_and_links_lead_somewhere(text: str) -> None:
    page = Page(text)
    assert len(page.ids) == len(set(page.ids))
    assert {address[1:] for address in page.addresses if address.startswith("#")} <= set(page.ids)


def test_every_picture_has_a_text_and_every_table_a_caption(text: str) -> None:
    page = Page(text)
    assert page.unnamed == []
    assert page.tags.count("caption") == page.tags.count("table") > 0
    assert page.tags.count("h1") == 1


def test_all_figures_and_claims_are_there(text: str) -> None:
    for number in range(3, 12):
        assert f'id="s1-figure-{number}"' in text
        assert f"The paper&#39;s Figure {number} " in text
    for claim in CLAIMS:
        assert f'href="#s1-claim-{claim.key}"' in text
        assert f'id="s1-claim-{claim.key}"' in text
    assert text.count("Nodes fetched per pixel by") == 4
    assert "stands in for the paper&#39;s Cornell Buddha" in text
    assert "A model, no measurement: Made-up lines." in text
    assert text.count("A model, not a measurement: made-up instructions.") == 1


def test_text_in_charts_stays_text_and_colours_follow_the_page(text: str) -> None:
    chart = text[text.index('<svg class="chart"') :]
    chart = chart[: chart.index("</svg>")]
    assert ">bvh-restart-trail</text>" in chart
    assert "fill: var(--s0)" in chart
    assert re.search(r"#0[1-9]0[1-9]0[1-9]", chart) is None


def test_hostile_names_stay_text(tmp_path: Path) -> None:
    def hostile(cell: Cell, document: Json) -> Json:
        device = {**document["device"], "id": HOSTILE, "name": HOSTILE, "driver": HOSTILE}
        scene = HOSTILE if cell.scene == "forest" else cell.scene
        model = {**document["model"], "alu_text": HOSTILE}
        return document | {"device": device, "scene": scene, "model": model, "started_at": HOSTILE}

    text, _ = render_report(World(change=hostile).documents(), nothing, Links("/studies/1", "/x"), HOSTILE)
    page = Page(text)
    assert "script" not in page.tags
    assert "&lt;script&gt;alert(1)" in text
    assert "$x^2$" in text


def test_a_section_for_each_device_and_version() -> None:
    other = World(seed=2, change=lambda _, d: d | {"device": {**d["device"], "id": "phone", "name": "Phone"}})
    newer = World(seed=3, change=lambda _, d: d | {"versions": {**d["versions"], "rayfarm": "0.2.0"}})
    documents = [*World().documents(), *other.documents(), *newer.documents()]
    text, verdicts = render_report(documents, nothing)
    assert len(verdicts) == 3 * len(CLAIMS)
    assert len(sections(documents)) == 3
    assert text.count('<section class="device"') == 3
    assert Page(text).ids.count("s2") == 1
    alone = judge(other.documents())
    assert [v.finding for v in verdicts[len(CLAIMS) : 2 * len(CLAIMS)]] == [v.finding for v in alone]


def test_of_several_results_of_a_cell_the_latest_counts() -> None:
    old, new = World(time=lambda _: 9.0, seed=5).documents(), World().documents()
    [section] = sections([*old, *new])
    assert section.repeated == len(old)
    assert list(section.documents.values()) == new


def test_a_mean_over_cells_is_what_a_hand_computes() -> None:
    """The ratio and the interval of one claim, from the documents by another way."""
    world = World(time=lambda cell: 0.8 if cell.method == "hybrid" else 1.0, noise=0.1, rounds=5, clock="wall")
    documents = world.documents()

    def rounds(method: str) -> list[list[float]]:
        kept = [
            d for d in documents if d["method"] == method and d["layout"] == "normal" and d["sah"]["traversal"] == 3
        ]
        each = [[median(r) for r in by_round(d["frames_ms"], d["frames_by_round"])] for d in kept]
        assert len(each) == 4 * len(SCENES)
        return [[math.prod(column) ** (1 / len(column))] for column in zip(*each, strict=True)]

    expected = difference(rounds("fragment"), rounds("hybrid"))
    found = judge(documents)[0].finding
    assert (found.value, found.low, found.high) == pytest.approx((expected.ratio, expected.low, expected.high))


def test_imported_profiles_are_used_where_all_have_them_and_named() -> None:
    def profiled(_: Cell, document: Json) -> Json:
        return document | {"profile": {"sp_memory_read": 5e6, "alu_per_fragment": 900.0, "imported": "agi (profile 1)"}}

    documents = World(change=profiled).documents()
    text, _ = render_report(documents, nothing)
    assert text.count("Figures of imported profiles") == 4
    [section] = sections(documents)
    assert {choose(section, section.documents, kinds).basis for kinds in (TRAFFIC, MEMORY, ALU)} == {"imported"}
    some = documents[:1] + World().documents()[1:]
    text, _ = render_report(some, nothing)
    assert "1 result of 96 have imported profiles: too few for this" in text.replace("\n", " ")
    [section] = sections(some)
    assert {choose(section, section.documents, kinds).basis for kinds in (TRAFFIC, MEMORY, ALU)} == {"model"}


def test_what_was_not_measured_is_said() -> None:
    def less(cell: Cell, document: Json) -> Json | None:
        return None if cell.method == "hybrid" or cell.sah != (3.0, 1.5) else document | {"model": None}

    text, verdicts = render_report(World(change=less).documents(), nothing)
    found = {verdict.claim.key: verdict for verdict in verdicts}
    assert found["hybrid-best"].outcome == "undecided"
    assert found["backtrack-fewest-alu"].outcome == "undecided"
    assert "No SAH costs but 3, 1.5 were measured." in text
    assert "No counts per pixel of forest are kept with these results." in text


def test_one_missing_cell_is_listed_and_denies_a_claim_about_all() -> None:
    def without(cell: Cell, document: Json) -> Json | None:
        gone = cell == Cell("forest", "kd-backtrack", layout="split")
        return None if gone else document

    found = {v.claim.key: v.finding for v in judge(World(change=without).documents())}
    assert found["split-everywhere"].outcome == "undecided"
    assert any("kd-backtrack split on forest: not measured" in line for line in found["split-everywhere"].missing)


def test_rounds_that_did_not_alternate_are_not_compared() -> None:
    def apart(cell: Cell, document: Json) -> Json:
        hour = 2 if cell.method == "hybrid" else 1
        return document | {"rounds_started_at": [f"2026-01-01T0{hour}:00:0{i}+00:00" for i in range(6)]}

    world = World(time=lambda cell: 0.5 if cell.method == "hybrid" else 1.0, change=apart)
    found = {v.claim.key: v.finding for v in judge(world.documents())}
    for key in ("hybrid-beats-fragment", "hybrid-best"):
        assert found[key].outcome == "undecided"
        assert "did not alternate" in found[key].missing[0]
    assert found["fragment-compute-equal"].outcome == "holds"


def broken(make: Callable[[Json], Json]) -> World:
    return World(change=lambda _, document: make(document), scenes={"cornell-box": 36, "forest": 174_000})


@pytest.mark.parametrize(
    "make",
    [
        lambda d: {**d, "device": None, "versions": None},
        lambda d: {**d, "frames_ms": [-1.0] * 12, "frames_cpu_ms": ["x"] * 12},
        lambda d: {**d, "frames_by_round": None, "rays": None, "error": None, "model": [], "pictures": "x"},
        lambda d: {**d, "triangles": None, "size": [], "per_ray": {"nodes": math.inf, "bytes": True}},
        lambda d: {**d, "pictures": {"image": "../../etc/passwd", "counts": 7}, "profile": {"sp_memory_read": "1"}},
        lambda d: {name: d[name] for name in ("scene", "traversal", "method", "layout", "sah")},
    ],
)
def test_documents_that_lack_things_are_reported_as_they_are(make: Callable[[Json], Json], tmp_path: Path) -> None:
    text, verdicts = render_report(broken(make).documents(), pictures_in(tmp_path))
    assert len(verdicts) == len(CLAIMS)
    assert "nan" not in re.sub(r"<svg.*?</svg>|data:[^\"]*", "", text, flags=re.DOTALL).lower().split()


@pytest.mark.parametrize("documents", [[], [{"scene": "forest", "traversal": "bvh-stack"}]])
def test_without_results_there_is_one_sentence(documents: list[Json]) -> None:
    with pytest.raises(PaperError, match="run the study `paper` first"):
        judge(documents)


def test_pictures_that_are_none_are_left_out() -> None:
    world = World(change=lambda _, d: d | {"pictures": {"image": "a" * 64, "counts": "b" * 64}})
    text, _ = render_report(world.documents(), lambda _: b"\x89PNG\r\n\x1a\nbroken")
    assert "No counts per pixel" in text
    assert "not kept" in text


def test_the_verdicts_are_plain_json() -> None:
    view = json.loads(json.dumps(claims_view(judge(World().documents())), allow_nan=False))
    assert sum(view["outcomes"].values()) == len(view["claims"]) == len(CLAIMS)
    first = view["claims"][0]
    assert first["id"] == "hybrid-beats-fragment"
    assert first["paper"] == {"section": "section 5", "figure": 3, "said": CLAIMS[0].said}
    assert len(first["parts"]) == 12


def test_the_same_results_give_the_same_bytes(text: str) -> None:
    documents = World().documents()
    assert render_report(documents, nothing)[0] == render_report(documents, nothing)[0]


def test_figures_show_every_scene_and_the_error_beside_the_speed() -> None:
    [section] = sections(World().documents())
    shown = {figure.number: figure for figure in figures(section)}
    assert sorted(shown) == list(range(3, 12))
    assert [panel.title for panel in shown[3].panels] == list(SCENES)
    assert [bar.note for _, bars in shown[7].panels[0].groups for bar in bars] == ["error 2.0×10⁻⁵"] * 4
    assert [bar.series for bar in shown[10].panels[0].groups[0][1]] == ["1.5, 3", "2, 1.5", "3, 1.5", "6, 1.5"]
    assert shown[6].scene == "cornell-statue"
    renamed = replace(World(), scenes={"a.obj": 10, "b.obj": 9000})
    assert figures(sections(renamed.documents())[0])[2].absent == "The scene was not measured."
