"""What a section was measured with: device, versions, settings, scenes, load."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from server.paper.data import Section, number
from server.paper.heatmaps import Pictures, rendered
from server.paper.roles import entry_of, role_of
from server.paper.words import counted

_LABELS = {
    "name": "Device",
    "device": "Device id",
    "driver": "Driver",
    "threads": "Rasteriser threads",
    "cores": "Cores",
    "machine": "Machine",
    "rayfarm": "RayFarm",
    "plan": "Plan format",
    "size": "Size in pixels",
    "rays": "Rays timed",
    "intersector": "Intersector",
    "box": "Box test",
    "nodes": "Node format",
    "precision": "Precision",
    "offset": "Shadow offset",
    "builder": "Builder",
    "fetch": "Fetched from",
    "specialise": "Specialised to the scene",
}


@dataclass(frozen=True)
class SceneLine:
    """A scene as the report lists it; `picture` is an address that holds the image."""

    name: str
    title: str
    triangles: int
    role: str
    note: str
    picture: str | None


def facts(section: Section) -> list[tuple[str, str]]:
    """Names and values, in the order in which a reader wants them."""
    known = [(label, section.place[name]) for name, label in _LABELS.items() if section.place.get(name) != "None"]
    documents = list(section.documents.values())
    rounds = [float(len(document.get("frames_by_round") or [])) for document in documents]
    frames = [value for document in documents if (value := number(document, "frames")) is not None]
    loads = [value for document in documents if (value := number(document, "load_average")) is not None]
    started = sorted(str(document["started_at"]) for document in documents if document.get("started_at"))
    clock = "processor time of one thread, the fastest frame of a round"
    known += [
        ("Results", str(len(documents))),
        ("Rounds a result", _range(rounds)),
        ("Frames a result", _range(frames)),
        ("Clock of the verdicts", clock if section.clock == "cpu" else "wall time, the median frame of a round"),
        ("Load average", f"{_range(loads, 2)}, median {median(loads):.2f}" if loads else "not measured"),
        ("Measured", f"{started[0]} to {started[-1]}" if started else "not recorded"),
    ]
    if section.repeated:
        known.append(("Left out", f"{counted(section.repeated, 'older result')} of the same variants"))
    if section.others:
        known.append(("Not among the paper's traversals", counted(section.others, "result")))
    return known


def scene_lines(section: Section, pictures: Pictures) -> list[SceneLine]:
    """The scenes, the fewest triangles first."""
    lines = []
    for name, triangles in section.scenes.items():
        entry = entry_of(name)
        title, note = (entry.title, entry.note) if entry else (name, "")
        lines.append(SceneLine(name, title, triangles, role_of(name), note, rendered(section, name, pictures)))
    return lines


def _range(values: Sequence[float], digits: int = 0) -> str:
    if not values:
        return "not recorded"
    low, high = f"{min(values):.{digits}f}", f"{max(values):.{digits}f}"
    return low if low == high else f"{low} to {high}"
