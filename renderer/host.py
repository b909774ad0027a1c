"""What a host offers: the twin and the phone's agent both run plans, and nothing else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from renderer.plan import Plan

WARM_UP = 1
"""Frames run and dropped before the timed ones: the first compiles."""

Tile = tuple[tuple[int, int, int, int], npt.NDArray[np.uint32]]
"""A collected tile: (x, y, width, height) in pixels, and its buffer's words."""


class DeviceGoneError(RuntimeError):
    """A device that went away while it was used; the same work may succeed when it is back."""


@dataclass
class Frames:
    """Times of the frames in the order run, in seconds.

    `wall` is to completion; `cpu` is the host process's CPU time; `gpu` the GPU's own timer. `cpu` and `gpu` are empty
    where the host cannot tell them; a `gpu` time is None where the driver withdrew it (a disjoint interval).
    """

    wall: list[float] = field(default_factory=list)
    cpu: list[float] = field(default_factory=list)
    gpu: list[float | None] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Timed:
    """Timed frames: their times, the seconds until the first frame was done, the output (height, width, 4) with row 0
    at the bottom, and what the device's counters said beside each frame."""

    frames: Frames
    compile_s: float
    image: npt.NDArray[np.uint8]
    samples: dict[str, Any] | None = None


class Host(Protocol):
    """Runs plans. Every method raises PlanError with one sentence, and DeviceGoneError when the device goes away."""

    @property
    def lock(self) -> Path:
        """The file whose lock is held while the device runs."""

    @property
    def paces(self) -> bool:
        """Whether `between` of `measure` is called: work of ours can be put between two frames."""

    def device(self) -> dict[str, Any]:
        """The result's `device`."""

    def collect(self, plan: Plan) -> list[Tile]:
        """Run one frame of an instrumented plan and return its collected tiles."""

    def measure(self, plan: Plan, frames: int, between: Callable[[], None]) -> Timed:
        """Time `frames` frames after WARM_UP others, each to completion, with `between` after each."""
