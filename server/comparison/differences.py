"""Two sets of results paired and compared: every pair's difference, what its environments differ in, what is alone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from renderer.times.difference import Difference, by_round, difference
from renderer.variant import AXES
from server.comparison.derived import sah_text, specialise_text

DEFAULT_GATE = 0.01
"""The slowdown that an interval's lower bound must pass to stop a gate, as a fraction.

The interval alone keeps false alarms to 2.5 %; this keeps real but trifling differences from stopping anything.
"""

CLOCKS = ("auto", "wall", "cpu")
FIXED = ("scene", "size", "rays")
"""What two results must share, or their frames are not of the same rays."""
SETUP = (*FIXED, "device", *AXES, "sah", "specialise")
"""What tells results apart; pairs share all of it except what is compared."""
ENVIRONMENT = ("device", "name", "driver", "threads", "cores", "machine", "rayfarm", "plan", "shader_sha")

Json = dict[str, Any]
Place = Mapping[str, str]


@dataclass(frozen=True)
class Beside:
    """What two results differ in besides time.

    `size` is the bytes of structure and primitives, against by baseline. `same_answers` tells whether every ray and
    every hit has the same bits. None is not known. `left_out` lists what the plan of each left out for its scene, where
    the two differ in that.
    """

    size: float | None
    same_answers: bool | None
    left_out: tuple[tuple[str, ...], tuple[str, ...]]

    @property
    def hits(self) -> str:
        """`same bits` or `other bits`; nothing where that is not known."""
        return {True: "same bits", False: "other bits", None: ""}[self.same_answers]

    @property
    def notes(self) -> list[str]:
        """What each side left out, in words."""
        sides = zip(("baseline", "against"), self.left_out, strict=True)
        return [f"left out of {side}: {', '.join(names)}" for side, names in sides if names]


@dataclass(frozen=True)
class Pair:
    """One comparison. `compared` and `environment` give what differs as (baseline, against), each by its name.

    `clock` is `wall`, the median of each round, or `cpu`, the fastest frame of each: neighbours only ever add to
    processor time. `apart` tells that one side's rounds all ended before the other's began, so that a change of the
    machine in between looks like a difference; None where that is not known. `repeated` counts the older results of
    either side that stand behind these.
    """

    place: dict[str, str]
    compared: dict[str, tuple[str, str]]
    environment: dict[str, tuple[str, str]]
    clock: str
    apart: bool | None
    repeated: int
    difference: Difference
    beside: Beside


@dataclass(frozen=True)
class Differences:
    """All pairs of two sides, and the places of the results that found no partner."""

    pairs: list[Pair]
    only_baseline: list[dict[str, str]]
    only_against: list[dict[str, str]]

    def slower(self, margin: float) -> list[Pair]:
        """The pairs that a gate stops at."""
        return [pair for pair in self.pairs if pair.difference.is_slower_by(margin)]


def find_differences(
    baseline: Sequence[Json], against: Sequence[Json], named: Iterable[str] = (), clock: str = "auto"
) -> Differences:
    """Pair results, each side's oldest first, on all of SETUP except `named`; raise DifferenceError for bad frames.

    One result against one are always compared where FIXED agrees, and what they differ in is told. Where a side holds
    several results in one place, its latest is taken: rounds of different runs are not pooled.
    """
    alone = len(baseline) == len(against) == 1
    matched = FIXED if alone else tuple(name for name in SETUP if name in FIXED or name not in set(named))
    first, second = _by_place(baseline, matched), _by_place(against, matched)
    pairs = [_pair(first[key], second[key], clock) for key in first if key in second]
    return Differences(
        pairs,
        [setup_of(results[-1]) for key, results in first.items() if key not in second],
        [setup_of(results[-1]) for key, results in second.items() if key not in first],
    )


def pair_of(baseline: Json, against: Json, clock: str = "auto") -> Pair:
    """Two results compared; raise DifferenceError for bad frames."""
    return _pair([baseline], [against], clock)


def setup_of(result: Json) -> dict[str, str]:
    """What was measured, each of SETUP as text."""
    costs = result.get("sah") or {}
    return {
        "scene": str(result.get("scene")),
        "size": "x".join(str(side) for side in result.get("size") or ()),
        "rays": str(result.get("rays_kind")),
        "device": str((result.get("device") or {}).get("id")),
        **{axis: str(result.get(axis)) for axis in AXES},
        "sah": sah_text(costs.get("traversal"), costs.get("intersection")),
        "specialise": specialise_text(result.get("specialised")),
    }


def environment_of(result: Json) -> dict[str, str]:
    """Where and with what it was measured, each of ENVIRONMENT as text."""
    device, versions = result.get("device") or {}, result.get("versions") or {}
    known = {**versions, **device, "device": device.get("id")}
    return {name: str(known.get(name)) for name in ENVIRONMENT}


def differences_view(found: Differences, margin: float) -> Json:
    """Differences as plain JSON; `passed` is false where a pair's lower bound passes `margin`."""
    return {
        "gate": margin,
        "passed": not found.slower(margin),
        "pairs": [_pair_view(pair, margin) for pair in found.pairs],
        "only_baseline": found.only_baseline,
        "only_against": found.only_against,
    }


def _pair_view(pair: Pair, margin: float) -> Json:
    found = pair.difference
    return {
        "place": pair.place,
        "compared": {name: list(values) for name, values in pair.compared.items()},
        "environment": {name: list(values) for name, values in pair.environment.items()},
        "clock": pair.clock,
        "apart": pair.apart,
        "repeated": pair.repeated,
        "rounds": list(found.rounds),
        "ratio": found.ratio,
        "low": found.low,
        "high": found.high,
        "visible": found.visible,
        "verdict": found.verdict,
        "stopped": found.is_slower_by(margin),
        "size": pair.beside.size,
        "same_answers": pair.beside.same_answers,
        "left_out": [list(names) for names in pair.beside.left_out],
    }


def _by_place(results: Sequence[Json], matched: Sequence[str]) -> dict[tuple[str, ...], list[Json]]:
    places: dict[tuple[str, ...], list[Json]] = {}
    for result in results:
        setup = setup_of(result)
        places.setdefault(tuple(setup[name] for name in matched), []).append(result)
    return places


def _pair(baseline: Sequence[Json], against: Sequence[Json], clock: str) -> Pair:
    first, second = baseline[-1], against[-1]
    used = _clock(first, second, clock)
    compared = _unlike(setup_of(first), setup_of(second))
    environment = _unlike(environment_of(first), environment_of(second))
    if any(name in AXES or name in ("sah", "specialise") for name in compared):
        environment.pop("shader_sha", None)  # Another variant has another shader: that is what is compared.
    return Pair(
        place={name: value for name, value in setup_of(first).items() if name not in compared},
        compared={name: values for name, values in compared.items() if name != "device"},
        environment=environment,
        clock=used,
        apart=_are_apart(first, second),
        repeated=len(baseline) + len(against) - 2,
        difference=difference(_rounds(first, used), _rounds(second, used), "fastest" if used == "cpu" else "median"),
        beside=_beside(first, second),
    )


def _beside(first: Json, second: Json) -> Beside:
    bytes_ = [(result.get("structure_bytes") or 0) + (result.get("primitive_bytes") or 0) for result in (first, second)]
    ours, theirs = first.get("answers_sha"), second.get("answers_sha")
    left_out = tuple(first.get("specialised") or ()), tuple(second.get("specialised") or ())
    return Beside(
        size=bytes_[1] / bytes_[0] if all(bytes_) else None,
        same_answers=ours == theirs if ours and theirs else None,
        left_out=left_out if left_out[0] != left_out[1] else ((), ()),
    )


def _unlike(first: Place, second: Place) -> dict[str, tuple[str, str]]:
    return {name: (value, second[name]) for name, value in first.items() if value != second[name]}


def _clock(first: Json, second: Json, wanted: str) -> str:
    """`auto` is processor time where one thread of a twin does all the work: neighbours disturb it least."""
    if wanted != "auto":
        return wanted
    for result in (first, second):
        device = result.get("device") or {}
        if device.get("kind") != "twin" or device.get("threads") != 1 or not result.get("frames_cpu_ms"):
            return "wall"
    return "cpu"


def _are_apart(first: Json, second: Json) -> bool | None:
    """Whether the rounds are not interleaved; ISO times of one zone are ordered as texts."""
    ours, theirs = (result.get("rounds_started_at") or [] for result in (first, second))
    return max(ours) < min(theirs) or max(theirs) < min(ours) if ours and theirs else None


def _rounds(result: Json, clock: str) -> list[list[float]]:
    frames = result.get("frames_cpu_ms" if clock == "cpu" else "frames_ms") or []
    return by_round(frames, result.get("frames_by_round"))
