"""What clients may send: bodies checked field by field, and turned into requests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, create_model, model_validator

from renderer.build.tree import SahCosts
from renderer.request import Check, Request, parse_size
from renderer.variant import AXES, Variant
from scenes.scene import Camera
from server.named_studies import STUDIES, require_study
from server.store.defaults import LLVMPIPE, NORMAL_PRIORITY
from server.studies import Study, with_changes
from server.study_axes import StudyError, read_costs, split_words

Coordinate = Annotated[float, Field(allow_inf_nan=False, ge=-1e9, le=1e9)]
Place = tuple[Coordinate, Coordinate, Coordinate]
Name = Annotated[str, Field(min_length=1, max_length=200)]


def _read_size(value: Any) -> Any:
    if isinstance(value, int) and not isinstance(value, bool):
        return (value, value)
    return parse_size(value) if isinstance(value, str) else value


def _read_switch(value: Any) -> Any:
    return {"on": True, "off": False}.get(value, value) if isinstance(value, str) else value


def _read_words(value: Any) -> Any:
    return [word.strip() for word in value.split(",") if word.strip()] if isinstance(value, str) else value


def _read_costs(value: Any) -> Any:
    return asdict(read_costs(value)) if isinstance(value, str) else value


def _read_axes(value: Any) -> Any:
    if not isinstance(value, dict):
        return value
    return {axis: split_words(axis, words) if isinstance(words, str) else words for axis, words in value.items()}


class Body(BaseModel):
    """A body without fields that do not exist."""

    model_config = ConfigDict(extra="forbid")


class CostsBody(Body):
    """The SAH's two costs; frozen, so that as a default it need not be copied for every body."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    traversal: float = 3.0
    intersection: float = 1.5


class CameraBody(Body):
    """A camera that replaces the scene's own; `fov` is the vertical field of view in degrees."""

    eye: Place
    target: Place
    fov: float = Field(gt=0, lt=180)
    up: Place = (0.0, 1.0, 0.0)

    @model_validator(mode="after")
    def _looks_somewhere(self) -> CameraBody:
        view = np.subtract(self.target, self.eye)
        if not np.linalg.norm(np.cross(view, self.up)) > 1e-9 * np.linalg.norm(view) * np.linalg.norm(self.up):
            raise ValueError("The camera looks nowhere: its eye, target and up must not lie on one line.")
        return self


Priority = Annotated[int, Field(ge=1, le=1_000_000, description="1 is the most urgent")]
Size = Annotated[tuple[int, int], BeforeValidator(_read_size)]
Switch = Annotated[bool, BeforeValidator(_read_switch)]
Words = Annotated[list[Name], BeforeValidator(_read_words)]
Costs = Annotated[CostsBody, BeforeValidator(_read_costs)]
Axes = Annotated[dict[str, list[Name]], BeforeValidator(_read_axes)]


def _require_here(gpus: Sequence[str], devices: Sequence[str]) -> None:
    """Refuse a phone for what is compiled without one."""
    other = next((device for device in devices if device != LLVMPIPE), None)
    if gpus and other is not None:
        raise ValueError(f"Compiling for GPUs takes no device: leave {other} out.")


def _axis(name: str) -> Any:
    """A variant's axis as a field; that its values and their combination exist is `Variant`'s to say."""
    return (str, Field(getattr(Variant, name), json_schema_extra={"enum": list(AXES[name])}))


_FIELDS: dict[str, Any] = {"scene": (Name, ...)} | {name: _axis(name) for name in AXES}
VariantBody = create_model("VariantBody", __base__=Body, **_FIELDS)
"""A scene, and a value on each axis of a variant."""


class JobBody(VariantBody):  # type: ignore[misc, valid-type]
    """One variant on one scene; the names are those of a result."""

    size: Size = (1024, 1024)
    frames: int = 12
    rounds: int | None = None
    rays: str = "both"
    sah: Costs = CostsBody()
    check: Check = "referee"
    vs_embree: Switch = False
    specialise: Switch = True
    models: Switch = False
    gpus: Words = Field([], description="compile for these GPUs, and measure nothing: adreno-540, mali-g57, ...")
    camera: CameraBody | None = None
    device: Name = LLVMPIPE
    priority: Priority = NORMAL_PRIORITY

    @model_validator(mode="after")
    def _compiles_here(self) -> JobBody:
        _require_here(self.gpus, [self.device])
        return self

    def to_request(self) -> Request:
        """The request; raise RequestError with one sentence when it cannot be measured."""
        axes = {axis: getattr(self, axis) for axis in AXES}
        given = "frames" in self.model_fields_set
        frames = 1 if self.gpus and not given else self.frames
        return Request(
            scene=self.scene,
            variant=Variant(**axes),
            size=self.size,
            frames=frames,
            rounds=min(4, max(1, frames)) if self.rounds is None else self.rounds,
            rays=self.rays,
            costs=SahCosts(self.sah.traversal, self.sah.intersection),
            check=self.check,
            vs_embree=self.vs_embree,
            specialise=self.specialise,
            models=self.models,
            gpus=tuple(self.gpus),
            camera=Camera(**self.camera.model_dump()) if self.camera else None,
        )


class StudyBody(Body):
    """A named study, changed where a field is given; or one matrix of scenes and axes under any name."""

    name: Name = "study"
    scenes: Words | None = None
    axes: Axes | None = Field(None, description="sah and size may be axes too: 3.0,1.5; 1.5,3.0 and 256,640x480")
    size: Size | None = None
    frames: int | None = None
    rounds: int | None = None
    repeats: int | None = None
    rays: str | None = None
    sah: Costs | None = None
    check: Check | None = None
    vs_embree: Switch | None = None
    specialise: Switch | None = None
    models: Switch | None = None
    gpus: Words | None = Field(None, description="compile for these GPUs, and measure nothing")
    devices: Words | None = None
    priority: Priority = NORMAL_PRIORITY

    @model_validator(mode="after")
    def _compiles_here(self) -> StudyBody:
        _require_here(self.gpus or [], self.devices or [LLVMPIPE])
        return self

    def to_study(self) -> Study:
        """The study; raise StudyError when it is neither a named one nor names scenes."""
        if self.scenes is not None and not self.scenes:
            raise StudyError("The study names no scene: give at least one.")
        named = self.name in STUDIES or self.scenes is None
        study = require_study(self.name) if named else Study(scenes=())
        if self.scenes is not None:
            study = with_changes(study, scenes=tuple(self.scenes), first_here=())
        if self.devices is not None:
            study = with_changes(study, devices=tuple(dict.fromkeys(self.devices)) or (LLVMPIPE,))
        fields = ("axes", "size", "frames", "rounds", "repeats", "rays", "check", "vs_embree", "specialise", "models")
        costs = SahCosts(self.sah.traversal, self.sah.intersection) if self.sah else None
        if self.gpus:
            study = with_changes(study, gpus=tuple(dict.fromkeys(self.gpus)))
        return with_changes(study, costs=costs, **{name: getattr(self, name) for name in fields})
