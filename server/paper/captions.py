"""What stands under each figure: what it shows, on what, with what intervals, and what the paper says of its own."""

from __future__ import annotations

from server.paper.data import COSTS, Json, Section, costs_text
from server.paper.figures import FigureData
from server.paper.measures import ALU_ESTIMATE, Measure
from server.paper.roles import role_of
from server.paper.words import counted

_SHOWS = {
    3: "The three rendering methods with the normal layout, for each traversal and scene.",
    4: "The three primitive layouts with fragment shaders, for each traversal and scene.",
    5: "Memory traffic of the three primitive layouts on the Cornell box, with fragment shaders.",
    6: "Memory traffic of the three primitive layouts on the scene in the Buddha's place, with fragment shaders.",
    7: "The four traversals on every scene, with fragment shaders and the normal layout.",
    8: "Nodes fetched from the structure's buffer by every pixel's primary and shadow rays, with fragment shaders and "
    "the normal layout.",
    9: "Memory read by the four traversals on every scene, with fragment shaders and the normal layout. Each scene has "
    "a scale of its own.",
    10: "Trees built with different SAH costs (traversal, intersection), by their ratio, with fragment shaders and the "
    "normal layout.",
    11: "ALU instructions per fragment of the four traversals, with fragment shaders and the normal layout. Each scene "
    "has a scale of its own.",
}

_PAPER = {
    3: "compares the performance of the methods; its text (section 5) finds fragment and compute similar and hybrid "
    "better.",
    4: "compares the layouts; its text (section 6) finds compact not always better, and split similar or better.",
    5: "shows memory bandwidth by layout on the Cornell box; its text (section 6) finds compact and split lower, split "
    "the lowest.",
    6: "shows the same on the Buddha; its text (section 6) finds compact and split lower, split the lowest.",
    7: "shows the traversals' performance by scene; its text (section 7.1) finds push-down good with few primitives "
    "and worst over all, trail best on complex scenes, backtrack and parent-link alike.",
    8: "shows heatmaps of the fairy scene for all structures; its text (section 7.1) finds that nodes traversed go "
    "with performance.",
    9: "shows SP Memory Read for each structure, the Cornell box too small to see; its text (section 7.1) finds "
    "KD-trees above BVHs.",
    10: "compares four pairs of SAH costs, of which the text names 3.0, 1.5 alone (section 3.2); it finds "
    "an intersection cost slightly below the traversal cost best (section 7.2).",
    11: "shows ALU instructions per fragment; its text (section 7.1) finds backtrack lowest and push-down highest.",
}

_LOST = "Its picture is lost, so no number of it is known."


def caption(section: Section, figure: FigureData) -> list[str]:
    """A figure's caption, a sentence or two for each subject."""
    scene = f" The scene is {figure.scene}, which is {role_of(figure.scene)}." if figure.scene else ""
    return [
        f"{_SHOWS[figure.number]}{scene}",
        f"Device: {section.place['name']}, {section.place['driver']}, {section.place['size']} pixels.",
        *([] if figure.absent else [_intervals(section, figure)]),
        f"The paper's Figure {figure.number} {_PAPER[figure.number]} {_LOST}",
    ]


def _intervals(section: Section, figure: FigureData) -> str:
    if figure.number == 8:
        return "Counts, exact for the scene: there is no interval."
    if figure.measure is not None:
        return _source(section, figure.measure)
    clock = "processor" if section.clock == "cpu" else "wall"
    return (
        f"Bars: frames in a second of {clock} time, by the median of all frames; whiskers: that median's 95 % interval "
        "by order statistics (from 6 frames on). Beside each figure stands the error: false hits, false misses and "
        "wrong primitives as a fraction of primary rays, for hybrid the pixels that rasterising sees otherwise. The "
        f"verdicts compare rounds. SAH costs are {costs_text(COSTS)} where nothing else is said."
    )


def _source(section: Section, measure: Measure) -> str:
    if measure.basis == "imported":
        return f"Figures of imported profiles ({measure.name}, {measure.unit}); not measured by this program."
    imported = sum(isinstance(document.get("profile"), dict) for document in section.documents.values())
    some = f" {counted(imported, 'result')} of {len(section.documents)} have imported profiles: too few for this."
    told = some if imported else ""
    if measure.basis == "model":
        said = model_text(section, measure.name)
        begin = "" if said.startswith(("A model", "Mesa")) else "A model, no measurement: "
        return f"{begin}{said} Exact for the scene: no interval.{told}"
    return f"Counted by the instrumented shader, exact for the scene: no interval.{told}"


def _estimate_text(model: Json) -> object:
    """What a result says of its estimate for the paper's GPU."""
    compiled = model.get("compiled")
    gpu = compiled.get("adreno_540") if isinstance(compiled, dict) else None
    return gpu.get("text") if isinstance(gpu, dict) else None


def model_text(section: Section, name: str) -> str:
    """What the results say of the model behind a figure."""
    for document in section.documents.values():
        model = document.get("model")
        if isinstance(model, dict):
            lines = model.get("lines")
            text = model.get("alu_text") if name.startswith("ALU") else isinstance(lines, dict) and lines.get("text")
            text = _estimate_text(model) if name == ALU_ESTIMATE.name else text
            if isinstance(text, str) and text:
                return text if text.endswith(".") else f"{text}."
    return "the results do not describe it."
