"""Results as the report needs them: a section for each device and its versions, one document for each cell."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from renderer.times.difference import DifferenceError
from renderer.variant import AXES, PAPER
from server.comparison.differences import environment_of, pair_of, setup_of

Json = dict[str, Any]
Costs = tuple[float, float]
Change = Mapping[str, Any]
"""Fields of a `Cell` that one side of a comparison replaces."""

COSTS: Costs = (3.0, 1.5)
"""The SAH costs of traversal and intersection that the paper settles on (sections 3.2.1 and 3.2.2)."""
TRAVERSALS = PAPER["traversal"]
FEW = 1000
"""A scene of at most so many triangles has few primitives, any other is complex: the paper's scenes have 36 triangles
(Cornell box) or 10^5 and more."""

_PARTS = ("traversal", "method", "layout", "sah")
_APART = tuple(name for name in ("size", "rays", *AXES, "specialise") if name not in _PARTS)


@dataclass(frozen=True, order=True)
class Cell:
    """What one document was measured for, within a section."""

    scene: str
    traversal: str = ""
    method: str = "fragment"
    layout: str = "normal"
    sah: Costs = COSTS

    def changed(self, change: Change) -> Cell:
        """The cell with some fields replaced."""
        return replace(self, **change)

    @property
    def text(self) -> str:
        """The cell in words: the scene, and what is not the default."""
        default = Cell(self.scene)
        named = [self.traversal] if self.traversal else []
        named += [getattr(self, name) for name in ("method", "layout") if getattr(self, name) != getattr(default, name)]
        named += [f"SAH {costs_text(self.sah)}"] if self.sah != COSTS else []
        return f"{' '.join(named)} on {self.scene}" if named else self.scene


@dataclass(frozen=True, eq=False)
class Section:
    """The results of one device with one set of versions and settings; they are never mixed with others.

    `place` names these in words. `scenes` maps each scene to its triangles, the fewest first. `clock` is `cpu` where
    one thread of a twin did all the work (as `server.comparison.differences` chooses), else `wall`. `repeated` older
    results of a cell and `others` of other traversals, or without the fields that name a cell, are left out.
    """

    place: dict[str, str]
    documents: dict[Cell, Json]
    scenes: dict[str, int]
    clock: str
    repeated: int
    others: int

    def few(self) -> list[str]:
        """The scenes with few primitives."""
        return [name for name, triangles in self.scenes.items() if triangles <= FEW]

    def complex(self) -> list[str]:
        """The other scenes."""
        return [name for name, triangles in self.scenes.items() if triangles > FEW]

    def sah_pairs(self) -> list[Costs]:
        """The SAH costs measured with fragment and normal, by their ratio of traversal to intersection."""
        pairs = {cell.sah for cell in self.documents if (cell.method, cell.layout) == ("fragment", "normal")}
        return sorted(pairs, key=lambda costs: (costs[0] / costs[1], costs))


def costs_text(costs: Costs) -> str:
    """SAH costs as `3, 1.5`."""
    return f"{costs[0]:g}, {costs[1]:g}"


def sections(documents: Iterable[Json]) -> list[Section]:
    """Sort results, the oldest first, into sections; of several results of one cell the latest counts."""
    groups: dict[tuple[tuple[str, str], ...], list[Json]] = {}
    for document in documents:
        groups.setdefault(tuple(_place(document).items()), []).append(document)
    found = [_section(dict(place), group) for place, group in groups.items()]
    return [section for section in found if section.documents]


def number(document: Json, *path: str) -> float | None:
    """A finite number somewhere in a document; None where there is none."""
    value: Any = document
    for name in path:
        value = value.get(name) if isinstance(value, dict) else None
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if math.isfinite(value) else None


def _place(document: Json) -> dict[str, str]:
    setup, environment = setup_of(document), environment_of(document)
    environment.pop("shader_sha")  # Every variant has its own.
    return environment | {name: setup[name] for name in _APART}


def _section(place: dict[str, str], group: Sequence[Json]) -> Section:
    cells = [(_cell(document), document) for document in group]
    kept = {cell: document for cell, document in cells if cell is not None}
    sizes: dict[str, int] = {}
    for cell, document in kept.items():
        sizes[cell.scene] = int(number(document, "triangles") or 0)
    return Section(
        place=place,
        documents=kept,
        scenes=dict(sorted(sizes.items(), key=lambda item: (item[1], item[0]))),
        clock=_clock(kept.values()),
        repeated=sum(cell is not None for cell, _ in cells) - len(kept),
        others=sum(cell is None for cell, _ in cells),
    )


def _cell(document: Json) -> Cell | None:
    scene, walk, method, layout = (document.get(name) for name in ("scene", "traversal", "method", "layout"))
    traversal, intersection = number(document, "sah", "traversal"), number(document, "sah", "intersection")
    if not all(isinstance(name, str) for name in (scene, walk, method, layout)) or walk not in TRAVERSALS:
        return None
    if not traversal or not intersection:
        return None
    return Cell(str(scene), str(walk), str(method), str(layout), (traversal, intersection))


def _clock(documents: Iterable[Json]) -> str:
    clocks = set()
    for document in documents:
        try:
            clocks.add(pair_of(document, document).clock)
        except (DifferenceError, TypeError):  # Frames that are missing, or that are no numbers.
            continue
    return "cpu" if clocks == {"cpu"} else "wall"
