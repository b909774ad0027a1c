"""The report: one HTML page that needs no network and no script.

`rayfarm study paper` calls `write_report(documents, pictures, path)` with the results in the order in which they were
measured and a function that gives a picture's bytes by its sha256 (`pictures_in` for a local run's folder); it returns
the verdicts, of which `server.paper.judging.claims_view` makes JSON.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from server.paper import words
from server.paper.captions import caption
from server.paper.charts import bars_svg
from server.paper.data import FEW, Json, Section
from server.paper.environment import SceneLine, facts, scene_lines
from server.paper.figures import FigureData, figures
from server.paper.heatmaps import Heatmaps, Pictures, heatmaps
from server.paper.judging import Verdicts, judge_section, require_sections
from server.paper.panels import Panel
from server.paper.rule_predicts import PREDICTS
from server.paper.verdict import OUTCOMES, Verdict

_TEMPLATES = Environment(
    loader=FileSystemLoader(Path(__file__).parent / "templates"),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)


@dataclass(frozen=True)
class Links:
    """Where the report stands on a service: its study's page, and the address that downloads it."""

    study: str
    download: str


@dataclass(frozen=True)
class Drawn:
    """A panel with its chart; `series` are the chart's names with their colours' numbers, where it has several."""

    panel: Panel
    svg: Markup
    series: tuple[tuple[str, int], ...]


@dataclass(frozen=True)
class FigurePart:
    """A figure ready for the page."""

    figure: FigureData
    caption: list[str]
    drawn: tuple[Drawn, ...]
    maps: Heatmaps | str | None
    verdicts: tuple[Verdict, ...]


@dataclass(frozen=True)
class SectionPart:
    """A section ready for the page; `id` begins the ids of its parts."""

    id: str
    name: str
    section: Section
    verdicts: Verdicts
    figures: tuple[FigurePart, ...]
    facts: list[tuple[str, str]]
    scenes: list[SceneLine]


def write_report(documents: Sequence[Json], pictures: Pictures, path: Path) -> Verdicts:
    """Judge results, write the report to `path` and return the verdicts; raise PaperError where there are no results.

    `pictures` gives a blob by its sha256, a PNG or an .npz of counts (`renderer.pictures.files`), or None.
    """
    text, verdicts = render_report(documents, pictures)
    path.write_text(text, encoding="utf-8")
    return verdicts


def render_report(
    documents: Sequence[Json], pictures: Pictures, links: Links | None = None, title: str = ""
) -> tuple[str, Verdicts]:
    """The report as text, with `links` where a service shows it; raise PaperError where there are no results."""
    parts = [_section(f"s{i}", section, pictures) for i, section in enumerate(require_sections(documents), 1)]
    verdicts = [verdict for part in parts for verdict in part.verdicts]
    context = {
        "title": title or "The paper's figures and claims",
        "parts": parts,
        "links": links,
        "outcomes": OUTCOMES,
        "plural": dict(zip(OUTCOMES, ("hold", "do not hold", "undecided"), strict=True)),
        "words": words,
        "few": FEW,
        "predicts": PREDICTS,
        "anchor": _anchor,
    }
    return _TEMPLATES.get_template("report.html").render(context), verdicts


def pictures_in(folder: Path) -> Pictures:
    """The pictures of a local run, `SHA.png` and `SHA.npz` in one folder."""

    def read(sha256: str) -> bytes | None:
        if not (len(sha256) == 64 and sha256.isalnum()):
            return None
        found = next((path for end in (".png", ".npz") if (path := folder / f"{sha256}{end}").is_file()), None)
        return None if found is None else found.read_bytes()

    return read


def _section(name: str, section: Section, pictures: Pictures) -> SectionPart:
    verdicts = judge_section(section)
    parts = tuple(_figure(name, section, each, pictures, verdicts) for each in figures(section))
    heading = f"{section.place['name']} ({section.place['device']}), {section.place['size']} pixels"
    return SectionPart(name, heading, section, verdicts, parts, facts(section), scene_lines(section, pictures))


def _figure(name: str, section: Section, figure: FigureData, pictures: Pictures, verdicts: Verdicts) -> FigurePart:
    drawn = []
    for i, panel in enumerate(figure.panels):
        series = panel.series
        svg = Markup(bars_svg(panel, f"{name}f{figure.number}p{i}", series))
        drawn.append(Drawn(panel, svg, tuple((each, k) for k, each in enumerate(series)) if len(series) > 1 else ()))
    return FigurePart(
        figure,
        caption(section, figure),
        tuple(drawn),
        heatmaps(section, pictures) if figure.number == 8 else None,
        tuple(verdict for verdict in verdicts if verdict.claim.figure == figure.number),
    )


def _anchor(part: SectionPart, kind: str, key: Any) -> str:
    """The id of a part of the page."""
    return f"{part.id}-{kind}-{key}"
