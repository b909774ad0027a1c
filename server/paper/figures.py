"""The data of the paper's Figures 3 to 11 from one section of results."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from server.paper.data import COSTS, TRAVERSALS, Cell, Section, costs_text
from server.paper.measures import ALU, MEMORY, REQUESTED, TRAFFIC, Measure, choose
from server.paper.panels import Panel, cells_of, measure_bars, panel, speed_bars, speed_unit
from server.paper.roles import BUDDHA, CORNELL, scene_for
from server.paper.words import lower_first

METHODS = ("fragment", "compute", "hybrid")
LAYOUTS = ("normal", "compact", "split")

Groups = Mapping[str, Mapping[str, Cell]]


@dataclass(frozen=True)
class FigureData:
    """One figure: its panels, or why there are none; `measure` where it shows no speeds."""

    number: int
    title: str
    panels: tuple[Panel, ...]
    measure: Measure | None = None
    scene: str | None = None
    absent: str = ""


def figures(section: Section) -> list[FigureData]:
    """Figures 3 to 11 in their order; Figure 8 has no panels here (`server.paper.heatmaps`)."""
    return [
        _speeds(section, 3, "Rendering methods", _by_traversal("method", METHODS)),
        _speeds(section, 4, "Primitive layouts", _by_traversal("layout", LAYOUTS)),
        _traffic(section, 5, "Memory traffic by layout, Cornell box", scene_for(section.scenes, CORNELL)),
        _traffic(section, 6, "Memory traffic by layout, Buddha", scene_for(section.scenes, BUDDHA)),
        _speeds(section, 7, "Traversals by scene", _traversals),
        FigureData(8, "Heatmaps of nodes traversed", ()),
        _measured(section, 9, "Memory read by structure", MEMORY),
        _sah(section),
        _measured(section, 11, "ALU instructions per fragment", ALU),
    ]


def _by_traversal(field: str, values: tuple[str, ...]) -> Callable[[str], Groups]:
    def groups(scene: str) -> Groups:
        return {
            traversal: {value: Cell(scene, traversal).changed({field: value}) for value in values}
            for traversal in TRAVERSALS
        }

    return groups


def _traversals(scene: str) -> Groups:
    return {traversal: {"fragment, normal": Cell(scene, traversal)} for traversal in TRAVERSALS}


def _speeds(section: Section, number: int, title: str, groups: Callable[[str], Groups]) -> FigureData:
    """Speeds in every scene that has more than one of the figure's values."""
    shown = []
    for scene in section.scenes:
        wanted = groups(scene)
        had = {name for cells in wanted.values() for name, cell in cells.items() if cell in section.documents}
        if len(had) > 1 or (had and number == 7):
            shown.append(panel(scene, speed_unit(section), wanted, speed_bars(section)))
    return _figure(number, title, shown)


def _traffic(section: Section, number: int, title: str, scene: str | None) -> FigureData:
    if scene is None:
        return FigureData(number, title, (), absent="The scene was not measured.")
    groups = _by_traversal("layout", LAYOUTS)(scene)
    measure = choose(section, cells_of([groups]), TRAFFIC)
    shown = [panel(f"{scene}: {lower_first(measure.name)}", measure.unit, groups, measure_bars(section, measure))]
    if measure.basis != "imported":
        name = f"{scene}: {lower_first(REQUESTED.name)}"
        shown.append(panel(name, REQUESTED.unit, groups, measure_bars(section, REQUESTED)))
    return _figure(number, title, shown, measure, scene)


def _measured(section: Section, number: int, title: str, measures: tuple[Measure, ...]) -> FigureData:
    groups = {scene: _traversals(scene) for scene in section.scenes}
    measure = choose(section, cells_of(groups.values()), measures)
    shown = [panel(scene, measure.unit, each, measure_bars(section, measure)) for scene, each in groups.items()]
    return _figure(number, title, shown, measure)


def _sah(section: Section) -> FigureData:
    pairs = section.sah_pairs()
    title = "SAH costs of traversal and intersection"
    if len(pairs) < 2:
        return FigureData(10, title, (), absent=f"No SAH costs but {costs_text(COSTS)} were measured.")
    shown = [
        panel(
            scene,
            speed_unit(section),
            {walk: {costs_text(pair): Cell(scene, walk, sah=pair) for pair in pairs} for walk in TRAVERSALS},
            speed_bars(section),
        )
        for scene in section.scenes
    ]
    return _figure(10, title, shown)


def _figure(
    number: int, title: str, shown: list[Panel], measure: Measure | None = None, scene: str | None = None
) -> FigureData:
    panels = tuple(each for each in shown if not each.empty)
    return FigureData(number, title, panels, measure, scene, "" if panels else "Nothing of it was measured.")
