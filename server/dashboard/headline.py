"""A result's figures in words: each with its unit, its interval, and what belongs to it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from server.comparison.figures import NOT_MEASURED, write_figure, write_interval, write_value
from server.comparison.flat import flatten_document
from server.comparison.metrics import METRICS, read_figure
from server.profiles.paper import PAPER

Json = dict[str, Any]


@dataclass(frozen=True)
class Line:
    """One figure with its name, and what stands in small letters below it."""

    name: str
    text: str
    detail: str = ""
    measured: bool = True


def headline(document: Json, request: Json) -> list[Line]:
    """The figures of a result, those first that decide."""
    flat = flatten_document(document)
    frames, rounds = document.get("frames") or 0, len(document.get("frames_by_round") or [0])
    return [
        _figure("Speed", "mrays_per_s", flat, _interval("mrays_per_s", flat) or "no interval: that takes 6 frames"),
        _figure(
            "Frame time", "frame_ms_median", flat, f"median of {frames} in {counted(rounds, 'round')}; {_fps(flat)}"
        ),
        _figure("Per CPU second", "mrays_per_cpu_s", flat, "" if flat.get("mrays_per_cpu_s") else "no CPU time told"),
        _rays(document),
        _error(document, flat, request),
        _size(document, flat),
        _work(flat),
        _embree(flat, request),
        *_models(document.get("model") or {}, flat),
    ]


def paper_lines(profile: Json) -> list[Line]:
    """The paper's figures of a job's profiles."""
    lines = []
    for key in PAPER:
        metric = METRICS[f"profile_{key}"]
        figure = read_figure(metric, {metric.key: profile.get(key)})
        several = key in (profile.get("ambiguous") or ())
        detail = "several series have it, see below" if several else ""
        name = metric.label.removesuffix(" (imported)")
        lines.append(Line(name, write_figure(metric, figure), detail, figure.value is not None))
    return lines


def _figure(name: str, key: str, flat: Json, detail: str = "") -> Line:
    figure = read_figure(METRICS[key], flat)
    return Line(name, write_figure(METRICS[key], figure), detail, figure.value is not None)


def _interval(key: str, flat: Json) -> str:
    interval = write_interval(METRICS[key], read_figure(METRICS[key], flat))
    return f"{interval} with 95 % confidence" if interval else ""


def _fps(flat: Json) -> str:
    interval = _interval("frame_ms_median", flat)
    fps = write_figure(METRICS["fps"], read_figure(METRICS["fps"], flat))
    return listed((interval, fps), "; ")


def _rays(document: Json) -> Line:
    timed, rays = document.get("rays_timed"), document.get("rays") or {}
    cast = " and ".join(f"{rays[kind]:,} {kind}" for kind in ("primary", "shadow") if rays.get(kind) is not None)
    if timed is None:
        return Line("Rays", NOT_MEASURED, measured=False)
    kinds = document.get("rays_kind") or "both"
    which = "both" if kinds == "both" else f"the {kinds} rays"
    return Line("Rays", f"{timed:,} a frame", f"{cast} cast, counted; {which} timed" if cast else "")


def _error(document: Json, flat: Json, request: Json) -> Line:
    figure = read_figure(METRICS["error_total"], flat)
    if figure.value is None:
        why = "submitted without a check" if request.get("check") == "none" else ""
        return Line("Error", NOT_MEASURED, why, measured=False)
    counts = (document.get("error") or {}).get("counts") or {}
    wrong = sum(counts.get(kind) or 0 for kind in ("false_hit", "false_miss", "wrong_primitive"))
    judged = f"{wrong:,} of {counts['primary']:,} primary rays wrong" if counts.get("primary") else ""
    others = [
        _part(flat, "error_edge", "too close to an edge to tell"),
        _part(flat, "error_shadow_mismatch", "shadows differ"),
    ]
    return Line("Error", write_figure(METRICS["error_total"], figure), "; ".join(x for x in (judged, *others) if x))


def _part(flat: Json, key: str, words: str) -> str:
    figure = read_figure(METRICS[key], flat)
    return "" if figure.value is None else f"{words}: {write_value(METRICS[key], figure.value)}"


def _size(document: Json, flat: Json) -> Line:
    primitives = write_value(METRICS["primitive_bytes"], read_figure(METRICS["primitive_bytes"], flat).value)
    triangles = document.get("triangles")
    parts = [
        f"with {primitives} of primitives" + (f", {triangles:,} triangles" if triangles is not None else ""),
        f"depth {document['depth']}" if document.get("depth") is not None else "",
        f"built in {document['build_ms']:.3g} ms" if document.get("build_ms") is not None else "",
    ]
    return _figure("Structure", "structure_bytes", flat, listed(parts, "; "))


def _work(flat: Json) -> Line:
    triangles, read = (METRICS[f"per_ray_{name}"] for name in ("triangles", "bytes"))
    tested = write_value(triangles, read_figure(triangles, flat).value)
    fetched = write_value(read, read_figure(read, flat).value)
    line = _figure("Work per ray", "per_ray_nodes", flat)
    detail = f"{tested} triangles tested, {fetched} fetched" if line.measured else "no counters in passes"
    return Line(line.name, line.text.removesuffix("/ray"), detail, line.measured)


def _embree(flat: Json, request: Json) -> Line:
    ours = (flat.get("vs_embree_mrays_per_cpu_s"), flat.get("vs_embree_ratio"))
    if ours[1] is None:
        asked = "this device's CPU time is not known" if request.get("vs_embree") else "not asked for"
        return _figure("Against Embree", "vs_embree_ratio", flat, asked)
    return _figure(
        "Against Embree",
        "vs_embree_ratio",
        flat,
        f"Embree {ours[0]:.3g} Mray a CPU second, same rays" if ours[0] else "",
    )


def _models(model: Json, flat: Json) -> list[Line]:
    """Figures that are computed, not measured, each with the sentence that says how."""
    lines, found = model.get("lines") or {}, []
    if flat.get("per_ray_lines") is not None:
        found.append(Line("Cache lines per ray, a model", f"{flat['per_ray_lines']:.3g}", str(lines.get("text") or "")))
    if model.get("alu_per_fragment") is not None:
        a_ray = "" if model.get("alu_per_ray") is None else f"{model['alu_per_ray']:,.0f} a ray. "
        text = f"{a_ray}{model.get('alu_text') or ''}"
        found.append(Line("ALU per fragment, a model", f"{model['alu_per_fragment']:,.0f}", text))
    return found


def counted(number: int, what: str) -> str:
    """A number of things: `1 round`, `3 rounds`."""
    return f"{number:,} {what}{'' if number == 1 else 's'}"


def listed(parts: Iterable[str], between: str) -> str:
    """The parts that there are, in one line."""
    return between.join(part for part in parts if part)
