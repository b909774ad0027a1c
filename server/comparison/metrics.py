"""The figures that a comparison shows: where each stands in a result, its unit, and which way is better."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from renderer.phone_compile.gpus import GPUS, USUAL

Flat = Mapping[str, Any]
Kind = Literal["number", "bytes", "fraction"]
Better = Literal["higher", "lower"]


class MetricError(ValueError):
    """A metric that does not exist; the message is one sentence that names those that do."""


@dataclass(frozen=True)
class Metric:
    """One figure. `key` is its name in a flattened result (`_` between levels).

    `from_frames` marks figures that are a constant divided by (`rate`) or proportional to (`time`) the frame time, so
    that the frame time's 95 % interval gives theirs. `model` is set for what is computed, not measured: the column of a
    flattened result that tells how; its label says so, too.
    """

    key: str
    label: str
    unit: str
    better: Better
    kind: Kind = "number"
    from_frames: Literal["", "rate", "time"] = ""
    model: str = ""


ERROR_PARTS = ("error_false_hit", "error_false_miss", "error_wrong_primitive")


COMPILED = "model_compiled_"
"""What the estimates' keys begin with."""


def _compiled(name: str) -> tuple[Metric, Metric]:
    """A GPU's estimates."""
    column, label = f"{COMPILED}{name.replace('-', '_')}", GPUS[name].label
    return (
        Metric(
            f"{column}_alu_per_fragment",
            f"ALU per fragment, {name} ({label})",
            "ALU/fragment",
            "lower",
            model=f"{column}_text",
        ),
        Metric(
            f"{column}_memory_per_fragment",
            f"Memory operations per fragment, {name} ({label})",
            "operations/fragment",
            "lower",
            model=f"{column}_text",
        ),
    )


METRICS: dict[str, Metric] = {
    metric.key: metric
    for metric in (
        Metric("mrays_per_s", "Speed", "Mray/s", "higher", from_frames="rate"),
        Metric("mrays_per_cpu_s", "Speed per CPU", "Mray/CPU-s", "higher"),
        Metric("fps", "Frames per second", "fps", "higher", from_frames="rate"),
        Metric("frame_ms_median", "Frame time", "ms", "lower", from_frames="time"),
        Metric("vs_embree_ratio", "Ratio to Embree", "of Embree", "higher"),
        Metric("structure_bytes", "Structure size", "", "lower", "bytes"),
        Metric("primitive_bytes", "Primitive size", "", "lower", "bytes"),
        Metric("build_ms", "Build time", "ms", "lower"),
        Metric("per_ray_nodes", "Nodes per ray", "nodes/ray", "lower"),
        Metric("per_ray_triangles", "Triangles per ray", "tri/ray", "lower"),
        Metric("per_ray_bytes", "Bytes per ray", "/ray", "lower", "bytes"),
        Metric("per_ray_lines", "Cache lines per ray (model)", "lines/ray", "lower", model="model_lines_text"),
        Metric("model_alu_per_fragment", "ALU per fragment (model)", "ALU/fragment", "lower", model="model_alu_text"),
        *(metric for gpu in USUAL for metric in _compiled(gpu)),
        Metric("error_total", "Error", "of rays", "lower", "fraction"),
        Metric("error_false_hit", "False hits", "of rays", "lower", "fraction"),
        Metric("error_false_miss", "False misses", "of rays", "lower", "fraction"),
        Metric("error_wrong_primitive", "Wrong primitive", "of rays", "lower", "fraction"),
        Metric("error_edge", "Edge cases", "of rays", "lower", "fraction"),
        Metric("error_t_ulp_max", "Worst t of right hits", "ulp", "lower"),
        Metric("error_shadow_mismatch", "Shadow mismatch", "of shadow rays", "lower", "fraction"),
        Metric("error_shadow_self_hit", "Shadow rays that hit their own start", "of shadow rays", "lower", "fraction"),
        Metric("error_shadow_leak", "Shadow rays that leak", "of shadow rays", "lower", "fraction"),
        Metric("error_raster_mismatch", "Raster mismatch", "of pixels", "lower", "fraction"),
        Metric("error_flip", "FLIP of the picture", "", "lower"),
        Metric("error_psnr", "PSNR of the picture", "dB", "higher"),
        Metric("sah_cost", "SAH cost", "", "lower"),
        Metric("sah_epo", "End-point overlap", "", "lower"),
        Metric("profile_sp_memory_read", "SP memory read a draw (imported)", "", "lower", "bytes"),
        Metric("profile_sp_memory_read_per_s", "SP memory read (imported)", "/s", "lower", "bytes"),
        Metric("profile_shader_alu_capacity_utilized", "Shader ALU capacity utilized (imported)", "%", "higher"),
        Metric("profile_time_alus_working", "Time ALUs working (imported)", "%", "higher"),
        Metric("profile_alu_per_fragment", "ALU per fragment (imported)", "ALU/fragment", "lower"),
    )
}

DEFAULT_METRIC = "mrays_per_s"


@dataclass(frozen=True)
class Figure:
    """A metric's value in one result with its 95 % interval; None where it was not measured."""

    value: float | None
    low: float | None = None
    high: float | None = None


def require_metric(key: str) -> Metric:
    """A metric by its key; a dotted name (`per_ray.nodes`) is understood too."""
    name = key.replace(".", "_")
    if name == "error":
        name = "error_total"
    if name not in METRICS:
        raise MetricError(f"Unknown metric {key!r}: choose one of {', '.join(METRICS)}.")
    return METRICS[name]


def read_figure(metric: Metric, flat: Flat) -> Figure:
    """A metric's figure in a flattened result."""
    return _figure(metric, flat, _frame_times(flat))


def read_figures(flat: Flat) -> dict[str, Figure]:
    """All metrics' figures in a flattened result."""
    times = _frame_times(flat)
    return {key: _figure(metric, flat, times) for key, metric in METRICS.items()}


def _frame_times(flat: Flat) -> tuple[float, float, float] | None:
    """The median frame time with its interval's ends; None where one of them is missing."""
    median, low, high = (_number(flat.get(f"frame_ms_{part}")) for part in ("median", "ci_low", "ci_high"))
    return (median, low, high) if median and low and high else None


def _figure(metric: Metric, flat: Flat, times: tuple[float, float, float] | None) -> Figure:
    value = _total_error(flat) if metric.key == "error_total" else _number(flat.get(metric.key))
    if not metric.from_frames or value is None or times is None:
        return Figure(value)
    median, low, high = times
    if metric.from_frames == "rate":
        return Figure(value, value * median / high, value * median / low)
    return Figure(value, low, high)


def _total_error(flat: Flat) -> float | None:
    """False hits, false misses and wrong primitives together; None unless all were measured."""
    parts = [_number(flat.get(key)) for key in ERROR_PARTS]
    known = [part for part in parts if part is not None]
    return sum(known) if len(known) == len(parts) else None


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and value == value else None
