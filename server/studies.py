"""Studies: the ones that have a name, and how a study becomes jobs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from renderer.build.tree import SahCosts
from renderer.request import Check, Request
from renderer.variant import AXES, Variant, expand, matrix
from server.store.defaults import LLVMPIPE

MAX_SLICES = 20_000
MAX_REPEATS = 1000
BRUTE_FORCE_LIMIT = 1e9
"""`all` leaves out `brute-force` above this many ray-triangle tests a frame."""

Entry = Mapping[str, Any]
Words = str | Sequence[str]


class StudyError(ValueError):
    """A study that cannot be run; the message is one sentence that says what to do."""


@dataclass(frozen=True)
class Study:
    """A matrix of variants over scenes, and what every job of it asks for.

    `axes` gives each axis a comma list or values, `paper` and `all` included (`renderer.variant.expand`).
    `optional_scenes` are added where they are here. `repeats` holds every request so many times, one beside the other.
    """

    scenes: tuple[str, ...]
    axes: Mapping[str, Words] = field(default_factory=dict)
    optional_scenes: tuple[str, ...] = ()
    size: tuple[int, int] = (1024, 1024)
    frames: int = 9
    rounds: int = 3
    repeats: int = 1
    rays: str = "both"
    costs: SahCosts = SahCosts()
    check: Check = "referee"
    vs_embree: bool = False
    specialise: bool = True
    devices: tuple[str, ...] = (LLVMPIPE,)


STUDIES: dict[str, Study] = {
    "demo": Study(
        scenes=("cornell-box", "forest"),
        optional_scenes=("crytek-sponza",),
        axes={"traversal": "paper,bvh-stack", "method": "fragment", "layout": "normal"},
        size=(256, 256),
        frames=12,
        rounds=2,
        vs_embree=True,
    ),
    "aa": Study(
        scenes=("cornell-box",),
        size=(64, 64),
        frames=90,
        rounds=10,
        repeats=80,
        check="none",
        axes={"layout": "normal"},
    ),
}
"""The studies that have a name."""


@dataclass(frozen=True)
class Planned:
    """A study's jobs, and what was left out with reasons (`scene`, the variant's axes, `reason`)."""

    requests: list[Request]
    refused: list[dict[str, Any]]


def require_study(name: str) -> Study:
    """A named study; raise StudyError naming those that exist."""
    if name not in STUDIES:
        raise StudyError(f"Unknown study {name!r}: choose one of {', '.join(STUDIES)}, or give scenes.")
    return STUDIES[name]


def expand_axes(axes: Mapping[str, Words]) -> dict[str, tuple[str, ...]]:
    """Every named axis with its values; raise StudyError or VariantError for what does not exist."""
    unknown = [axis for axis in axes if axis not in AXES]
    if unknown:
        raise StudyError(f"Unknown axis {unknown[0]!r}: choose one of {', '.join(AXES)}.")
    chosen = {axis: expand(axis, words if isinstance(words, str) else ",".join(words)) for axis, words in axes.items()}
    return {axis: values for axis, values in chosen.items() if values}


def plan_study(study: Study, require_scene: Callable[[str], Entry], is_here: Callable[[str], bool]) -> Planned:
    """Turn a study into jobs; raise StudyError, VariantError, RequestError or SceneError when nothing can be run.

    `require_scene` gives a scene's catalogue entry or raises; `is_here` says whether an optional scene can be had.
    """
    scenes = [*study.scenes, *(name for name in study.optional_scenes if is_here(name))]
    if not scenes:
        raise StudyError("The study names no scene: give at least one.")
    entries = [require_scene(name) for name in dict.fromkeys(scenes)]
    variants, refused = matrix(expand_axes(study.axes), study.rays)
    left_out = [{"scene": None, **item.variant.as_dict(), "reason": item.reason} for item in refused]
    if not 1 <= study.repeats <= MAX_REPEATS:
        raise StudyError(f"The repeats are {study.repeats}: give a whole number from 1 to {MAX_REPEATS}.")
    requests: list[Request] = []
    for entry in entries:
        for variant in variants:
            reason = _too_much(study, entry, variant)
            if reason is None:
                requests += [_request(study, entry["name"], variant)] * study.repeats
            else:
                left_out.append({"scene": entry["name"], **variant.as_dict(), "reason": reason})
    _require_some(requests, left_out, len(study.devices))
    return Planned(requests, left_out)


def _request(study: Study, scene: str, variant: Variant) -> Request:
    return Request(
        scene=scene,
        variant=variant,
        size=study.size,
        frames=study.frames,
        rounds=min(study.rounds, study.frames),
        rays=study.rays,
        costs=study.costs,
        check=study.check,
        vs_embree=study.vs_embree,
        specialise=study.specialise,
    )


def _too_much(study: Study, entry: Entry, variant: Variant) -> str | None:
    words = study.axes.get("traversal", ())
    listed = [word.strip() for word in (words.split(",") if isinstance(words, str) else words)]
    if variant.structure != "none" or "all" not in listed or variant.traversal in listed:
        return None
    tests = study.size[0] * study.size[1] * (2 if study.rays == "both" else 1) * (entry.get("triangles") or 0)
    if tests <= BRUTE_FORCE_LIMIT:
        return None
    return f"all leaves out brute-force above 10^9 ray-triangle tests a frame; here they are {tests:.1e}."


def _require_some(requests: Sequence[Request], left_out: Sequence[Mapping[str, Any]], devices: int) -> None:
    if not requests:
        reasons = dict.fromkeys(str(item["reason"]) for item in left_out)
        raise StudyError(f"Every combination of the study is refused: {' '.join(reasons)}")
    slices = sum(request.rounds for request in requests) * devices
    if slices > MAX_SLICES:
        raise StudyError(f"The study has {slices} slices, more than {MAX_SLICES}: ask for fewer variants or rounds.")


def with_changes(study: Study, **changes: Any) -> Study:
    """The study with the given fields replaced; a field that is None is left as it is."""
    return replace(study, **{name: value for name, value in changes.items() if value is not None})
