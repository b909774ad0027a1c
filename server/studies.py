"""Studies: matrices over scenes, devices and every axis, and how they become jobs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from renderer.build.tree import SahCosts
from renderer.request import Check, Request
from renderer.variant import Variant, matrix
from server.store.defaults import LLVMPIPE
from server.study_axes import StudyError, Words, read_axes, split_words

MAX_SLICES = 20_000
MAX_REPEATS = 1000
MAX_COMBINATIONS = 100_000
BRUTE_FORCE_LIMIT = 1e9
"""`all` leaves out what tests every triangle above this many ray-triangle tests a frame."""

FIELD_AXES = {"size": "size", "costs": "sah", "specialise": "specialise"}
"""The fields of a study that are also axes."""

Entry = Mapping[str, Any]
Axes = Mapping[str, Words]


@dataclass(frozen=True)
class Study:
    """Matrices over scenes, and what every job of them asks for.

    `axes` gives each axis of `server.study_axes.STUDY_AXES` a list, `paper` and `all` included; an axis that it does
    not name has its default, or `size`, `costs` and `specialise` here. Each of the `parts` is a matrix of its own with
    further axes; what two of them ask for is measured once. Of each of `first_here` the first scene that is here is
    added. `repeats` holds every request so many times, one beside the other. With `gpus` the variants are compiled for
    these and not measured.
    """

    scenes: tuple[str, ...]
    axes: Axes = field(default_factory=dict)
    parts: tuple[Axes, ...] = ({},)
    first_here: tuple[tuple[str, ...], ...] = ()
    size: tuple[int, int] = (1024, 1024)
    frames: int = 12
    rounds: int = 4
    repeats: int = 1
    rays: str = "both"
    costs: SahCosts = SahCosts()
    check: Check = "referee"
    vs_embree: bool = False
    specialise: bool = True
    models: bool = False
    gpus: tuple[str, ...] = ()
    devices: tuple[str, ...] = (LLVMPIPE,)
    text: str = ""


@dataclass(frozen=True)
class Planned:
    """A study's requests, and what was left out with reasons (`scene`, the variant's axes, `reason`)."""

    requests: list[Request]
    refused: list[dict[str, Any]]

    @property
    def slices(self) -> int:
        """How many slices they have on one device."""
        return sum(request.rounds for request in self.requests)


def with_changes(study: Study, *, axes: Axes | None = None, **changes: Any) -> Study:
    """The study with the given fields replaced, and the given axes in every part; None leaves a field as it is.

    A size, costs or `specialise` that is given replaces the axis of the study that it is a value of.
    """
    given = {name: value for name, value in changes.items() if value is not None}
    replaced = {FIELD_AXES[name] for name in given if name in FIELD_AXES} | set(axes or ())
    parts = tuple(_without(part, replaced) for part in study.parts)
    return replace(study, axes={**_without(study.axes, replaced), **(axes or {})}, parts=parts, **given)


def scenes_of(study: Study, is_here: Callable[[str], bool]) -> list[str]:
    """The scenes that the study is measured on here."""
    found = (next((name for name in names if is_here(name)), None) for names in study.first_here)
    return list(dict.fromkeys([*study.scenes, *(name for name in found if name is not None)]))


def plan_study(study: Study, require_scene: Callable[[str], Entry], is_here: Callable[[str], bool]) -> Planned:
    """Turn a study into requests; raise StudyError, VariantError, RequestError or SceneError when none can be run.

    `require_scene` gives a scene's catalogue entry or raises; `is_here` says whether a scene can be had.
    """
    entries = [require_scene(name) for name in scenes_of(study, is_here)]
    if not entries:
        raise StudyError("The study names no scene: give at least one.")
    if not 1 <= study.repeats <= MAX_REPEATS:
        raise StudyError(f"The repeats are {study.repeats}: give a whole number from 1 to {MAX_REPEATS}.")
    asked: dict[Request, None] = {}
    left_out: dict[tuple[Any, ...], dict[str, Any]] = {}
    for part in study.parts:
        axes = {**study.axes, **part}
        _require_few(axes, len(entries))
        requests, refused = _plan_part(study, axes, entries)
        asked |= dict.fromkeys(requests)
        left_out |= {tuple(item.values()): item for item in refused}
    requests = [request for request in asked for _ in range(study.repeats)]
    _require_some(requests, list(left_out.values()), len(study.devices))
    return Planned(requests, list(left_out.values()))


def _plan_part(study: Study, axes: Axes, entries: Sequence[Entry]) -> tuple[list[Request], list[dict[str, Any]]]:
    values, settings = read_axes(axes)
    variants, refused = matrix(values, study.rays)
    left_out = [{"scene": None, **item.variant.as_dict(), "reason": item.reason} for item in refused]
    requests: list[Request] = []
    for entry, variant, changed in itertools.product(entries, variants, _settings(study, settings)):
        reason = _too_much(changed, axes, entry, variant)
        if reason is None:
            requests.append(_request(changed, entry["name"], variant))
        else:
            left_out.append({"scene": entry["name"], **variant.as_dict(), "reason": reason})
    return requests, left_out


def _settings(study: Study, values: Mapping[str, Sequence[Any]]) -> Iterator[Study]:
    """The study with each combination of the axes that are no variant's."""
    sizes = values.get("size", (study.size,))
    costs = values.get("sah", (study.costs,))
    for size, cost, specialise in itertools.product(sizes, costs, values.get("specialise", (study.specialise,))):
        yield replace(study, size=size, costs=cost, specialise=specialise)


def _request(study: Study, scene: str, variant: Variant) -> Request:
    return Request(
        scene=scene,
        variant=variant,
        size=study.size,
        frames=1 if study.gpus else study.frames,
        rounds=1 if study.gpus else min(study.rounds, study.frames),
        rays=study.rays,
        # Nothing is built for brute force, so its requests differ in no costs.
        costs=SahCosts() if variant.structure == "none" else study.costs,
        check=study.check,
        vs_embree=study.vs_embree,
        specialise=study.specialise,
        models=study.models,
        gpus=study.gpus,
    )


def _too_much(study: Study, axes: Axes, entry: Entry, variant: Variant) -> str | None:
    listed = split_words("traversal", axes.get("traversal", ()))
    if variant.structure != "none" or "all" not in listed or variant.traversal in listed:
        return None
    width, height = study.size
    tests = width * height * (2 if study.rays == "both" else 1) * (entry.get("triangles") or 0)
    if tests <= BRUTE_FORCE_LIMIT:
        return None
    return (
        f"all leaves out {variant.traversal} above 10^9 ray-triangle tests a frame; "
        f"at {width}x{height} they are {tests:.1e}."
    )


def _require_few(axes: Axes, scenes: int) -> None:
    values, settings = read_axes(axes)
    combinations = scenes * math.prod(len(each) for each in (*values.values(), *settings.values()))
    if combinations > MAX_COMBINATIONS:
        raise StudyError(
            f"The study has {combinations} combinations, more than {MAX_COMBINATIONS}: ask for fewer values."
        )


def _require_some(requests: Sequence[Request], left_out: Sequence[Mapping[str, Any]], devices: int) -> None:
    if not requests:
        reasons = dict.fromkeys(str(item["reason"]) for item in left_out)
        raise StudyError(f"Every combination of the study is refused: {' '.join(reasons)}")
    slices = sum(request.rounds for request in requests) * devices
    if slices > MAX_SLICES:
        raise StudyError(f"The study has {slices} slices, more than {MAX_SLICES}: ask for fewer variants or rounds.")


def _without(axes: Axes, names: set[str]) -> dict[str, Words]:
    return {axis: words for axis, words in axes.items() if axis not in names}
