"""What one job asks for, checked once, and its JSON form."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

from renderer.build.tree import SahCosts
from renderer.phone_compile.gpus import GPUS
from renderer.variant import Variant, VariantError, refusal, require_value
from scenes.scene import Camera

MAX_SIDE = 4096
RAYS = ("primary", "shadow", "both")
Check = Literal["none", "oracle", "referee", "image"]
"""Who judges: nobody, Embree, the referee where they disagree; `image` also holds the picture against the exact one."""

CHECKS: tuple[Check, ...] = get_args(Check)


class RequestError(ValueError):
    """A request that cannot be measured; the message is one sentence that says what to do."""


@dataclass(frozen=True)
class Request:
    """One variant on one scene: what to render, what to time, and how to judge it.

    `size` is (width, height) in pixels; `frames` are timed frames over all `rounds`; each round is a slice that runs
    in a fresh process. `rays` says what is timed. `camera` replaces the scene's own. `threads` is the number of
    rasteriser threads on llvmpipe. `models` adds the memory model and the ALU model. With `gpus` nothing is timed: the
    variant is compiled for these (`renderer.phone_compile`), in one frame of one round.
    """

    scene: str
    variant: Variant = Variant()
    size: tuple[int, int] = (1024, 1024)
    frames: int = 12
    rounds: int = 4
    rays: str = "both"
    costs: SahCosts = SahCosts()
    check: Check = "referee"
    vs_embree: bool = False
    specialise: bool = True
    camera: Camera | None = None
    threads: int = 1
    models: bool = False
    gpus: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check every value; raise RequestError with one sentence."""
        _check_one_of("rays", self.rays, RAYS)
        _check_one_of("check", self.check, CHECKS)
        _check_range("width", self.size[0], 1, MAX_SIDE)
        _check_range("height", self.size[1], 1, MAX_SIDE)
        _check_range("frames", self.frames, 1, 10_000)
        _check_range("rounds", self.rounds, 1, self.frames)
        _check_range("threads", self.threads, 1, 64)
        for name, cost in (("traversal", self.costs.traversal), ("intersection", self.costs.intersection)):
            if not 1e-6 <= cost <= 1e6:
                raise RequestError(f"The SAH {name} cost is {cost}: give a number from 1e-6 to 1e6.")
        for gpu in self.gpus:
            _check_one_of("GPU", gpu, tuple(GPUS))
        if self.gpus and (self.frames, self.rounds) != (1, 1):
            raise RequestError("A variant is compiled in one frame of one round: leave frames and rounds out.")
        try:
            reason = refusal(self.variant, self.rays)
        except VariantError as error:
            raise RequestError(str(error)) from error
        if reason is not None:
            raise RequestError(f"{self.variant.label} is refused: {reason}")

    def to_json(self) -> dict[str, Any]:
        """A dictionary of plain JSON values that `from_json` reads back."""
        return asdict(self) | {"size": list(self.size)}

    @staticmethod
    def from_json(data: dict[str, Any]) -> Request:
        """Read what `to_json` wrote; missing keys take their defaults."""
        values = dict(data)
        if "variant" in values:
            for axis, value in values["variant"].items():
                require_value(axis, value)
            values["variant"] = Variant(**values["variant"])
        if "costs" in values:
            values["costs"] = SahCosts(**values["costs"])
        if values.get("camera"):
            camera = values["camera"]
            points = {k: tuple(camera[k]) for k in ("eye", "target", "up") if k in camera}
            values["camera"] = Camera(fov=camera["fov"], **points)
        if "gpus" in values:
            values["gpus"] = tuple(values["gpus"])
        if "size" in values:
            width, height = values["size"]
            values["size"] = (int(width), int(height))
        return Request(**values)

    @property
    def key(self) -> str:
        """A short sha256 over the request, for names of files."""
        return hashlib.sha256(json.dumps(self.to_json(), sort_keys=True).encode()).hexdigest()[:16]


def parse_size(text: str) -> tuple[int, int]:
    """Read `W` or `WxH`; raise RequestError when it is neither."""
    parts = text.lower().split("x")
    if len(parts) > 2 or not all(part.strip().isdecimal() and len(part) < 10 for part in parts):
        raise RequestError(f"The size {text!r} is not understood: write it as 512 or 640x480.")
    numbers = [int(part) for part in parts]
    return (numbers[0], numbers[-1])


def _check_one_of(name: str, value: str, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        raise RequestError(f"Unknown {name} {value!r}: choose one of {', '.join(allowed)}.")


def _check_range(name: str, value: int, low: int, high: int) -> None:
    if not low <= value <= high:
        raise RequestError(f"The {name} is {value}: give a whole number from {low} to {high}.")
