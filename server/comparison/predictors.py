"""How well a tree's costs and a ray's work foretell the time of a ray, device by device, from measured results.

Costs are those of the tree: SAH (MacDonald and Booth 1990) and end-point overlap (Aila, Karras and Laine 2013, whose
sum of both, weighted, is fitted here). Work is counted along the rays that were timed. Time is a power of a predictor,
with one exponent for a device's rays and one factor for each variant, or one for all variants.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.variant import AXES

Row = Mapping[str, Any]
Doubles = npt.NDArray[np.float64]

LEAST = 3
"""The fewest results of a variant, on trees that differ, from which its factor is told."""

WEIGHTS = np.linspace(0.0, 1.0, 51)
"""The weights of end-point overlap beside the SAH that are tried."""

_VARIANT = (*(axis for axis in AXES if axis != "builder"), "size")


@dataclass(frozen=True)
class Predicted:
    """One predictor on one device, over `results` of `variants`.

    `explained` is the share of the variance of log time (R^2), `exponent` the fitted power, `off_by` the factor by
    which a prediction is typically wrong (root mean square of the logarithm); `weight` that of end-point overlap, if it
    is part. `across` are `explained` and `off_by` with one factor for all variants. `points` are predictor and time
    over their variant's geometric means.
    """

    key: str
    label: str
    results: int
    variants: int
    explained: float
    exponent: float
    off_by: float
    weight: float | None
    across: tuple[float, float]
    points: list[tuple[float, float]]


@dataclass(frozen=True)
class OnDevice:
    """The predictors of one kind of rays on one device, the best first."""

    device: str
    rays: str
    predictors: list[Predicted]


def _work(row: Row) -> float:
    return float(row["per_ray_inner"]) + float(row["per_ray_triangles"])


def _plain(key: str) -> Callable[[Row], float]:
    return lambda row: float(row[key])


PREDICTORS: dict[str, tuple[str, tuple[str, ...], Callable[[Row], float]]] = {
    "sah": ("SAH cost", ("sah_cost",), _plain("sah_cost")),
    "work": ("visits and triangles a ray", ("per_ray_inner", "per_ray_triangles"), _work),
    "nodes": ("nodes a ray", ("per_ray_nodes",), _plain("per_ray_nodes")),
    "bytes": ("bytes a ray", ("per_ray_bytes",), _plain("per_ray_bytes")),
}
"""By key: the label, the columns that it needs, and its value; SAH with end-point overlap comes beside them."""


def predictors(rows: Iterable[Row]) -> list[OnDevice]:
    """What foretells the time of a ray on each device, where results suffice; by device, then by rays."""
    by_device: dict[tuple[str, str], list[Row]] = defaultdict(list)
    for row in rows:
        if _speed(row) and row.get("structure_bytes"):
            by_device[str(row["device_id"]), str(row.get("rays_kind"))].append(row)
    found = []
    for (device, rays), held in sorted(by_device.items()):
        told = [one for one in (_predicted(key, held) for key in (*PREDICTORS, "overlap")) if one is not None]
        if told:
            found.append(OnDevice(device, rays, sorted(told, key=lambda one: -one.explained)))
    return found


def _speed(row: Row) -> float | None:
    """Rays a second: of processor time where it was measured, as nothing else disturbs it."""
    speed = row.get("mrays_per_cpu_s") or row.get("mrays_per_s")
    return float(speed) if speed else None


def _predicted(key: str, rows: Sequence[Row]) -> Predicted | None:
    label, columns, value = PREDICTORS["sah" if key == "overlap" else key]
    if key == "overlap":
        label, columns = "SAH cost with end-point overlap", ("sah_cost", "sah_epo")
    usable = [row for row in rows if all(row.get(column) is not None for column in columns) and value(row) > 0]
    groups = _groups(usable, value)
    if not groups:
        return None
    times = [np.array([-np.log(_speed(row) or 1.0) for row in held]) for held in groups]
    values = [np.array([value(row) for row in held]) for held in groups]
    if key != "overlap":
        return _fitted(key, label, values, times, None)
    overlaps = [np.array([float(row["sah_epo"]) for row in held]) for held in groups]
    weight = _best_weight(values, overlaps, times)
    return _fitted(key, label, _mixed(values, overlaps, weight), times, weight)


def _best_weight(costs: list[Doubles], overlaps: list[Doubles], times: list[Doubles]) -> float:
    """The weight of end-point overlap with which the sum explains most, of those that leave no sum at 0."""
    sums = {float(weight): _mixed(costs, overlaps, float(weight)) for weight in WEIGHTS}
    y = _centred(times)
    explained = {
        weight: _line(_centred([np.log(one) for one in mixed]), y)[0]
        for weight, mixed in sums.items()
        if all((one > 0).all() for one in mixed)
    }
    return max(explained, key=lambda weight: explained[weight])


def _mixed(costs: list[Doubles], overlaps: list[Doubles], weight: float) -> list[Doubles]:
    return [(1 - weight) * cost + weight * overlap for cost, overlap in zip(costs, overlaps, strict=True)]


def _centred(groups: list[Doubles]) -> Doubles:
    """All values less their own group's mean."""
    return np.concatenate([one - one.mean() for one in groups])


def _groups(rows: Sequence[Row], value: Callable[[Row], float]) -> list[list[Row]]:
    """The results of each variant, whatever built its trees, that has LEAST of them with values that differ."""
    by_variant: dict[tuple[str, ...], list[Row]] = defaultdict(list)
    for row in rows:
        by_variant[tuple(str(row.get(name)) for name in _VARIANT)].append(row)
    return [held for held in by_variant.values() if len({value(row) for row in held}) >= LEAST]


def _fitted(key: str, label: str, values: list[Doubles], times: list[Doubles], weight: float | None) -> Predicted:
    logs = [np.log(one) for one in values]
    x, y = _centred(logs), _centred(times)
    explained, exponent, off_by = _line(x, y)
    everything, every_time = np.concatenate(logs), np.concatenate(times)
    across = _line(everything - everything.mean(), every_time - every_time.mean())
    points = [(float(a), float(b)) for a, b in zip(np.exp(x), np.exp(y), strict=True)]
    return Predicted(
        key, label, len(x), len(values), explained, exponent, off_by, weight, (across[0], across[2]), points
    )


def _line(x: Doubles, y: Doubles) -> tuple[float, float, float]:
    """Of a line through the origin: the share of variance explained, its slope, and the factor that is left."""
    spread, total = float(x @ x), float(y @ y)
    slope = float(x @ y) / spread if spread else 0.0
    left = float(np.square(y - slope * x).sum())
    return 1 - left / total if total else 0.0, slope, float(np.exp(np.sqrt(left / len(y))))
