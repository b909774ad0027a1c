"""Measures many variants of one scene in turn on one host, for `renderer.recommend.halving`.

Scene, trees and buffers of equal contents are shared. What is measured and what is not is told apart: seconds for
preparing, compiling (with the frames that warm up), measuring and judging.
"""

from __future__ import annotations

import hashlib
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from functools import partial
from typing import Any, Literal, TypeVar
from weakref import WeakValueDictionary, ref

import numpy as np
import numpy.typing as npt

from renderer.answering import Say, silent
from renderer.build.errors import BuildError
from renderer.build.tree import Bvh
from renderer.host import Frames, Host
from renderer.instrumented import records_of, refuse_cut
from renderer.judge.accuracy import Errors, judge
from renderer.judge.oracle import Oracle
from renderer.judge.timed_image import refuse_apart
from renderer.kept_twins import KeptTwins
from renderer.locks import holding, machine_lock
from renderer.pack.nodes import PackError
from renderer.plan import Plan, PlanError
from renderer.prepare import Built, Prepared, build_tree, prepare
from renderer.recommend.halving import Candidate, Judged, Size
from renderer.request import Request
from renderer.times.interval import median
from scenes.load import load

MOST_BYTES = 2 << 30
"""The bytes of packed buffers that are kept; variants that were not used for longest are packed again."""
TELL_S = 3.0
"""How often it is told what is prepared."""

Value = TypeVar("Value")
Array = npt.NDArray[Any]
Clock = Literal["cpu", "wall"]


@dataclass(frozen=True)
class Facts:
    """What judging a variant at a size told beside the error: rays counted, and the mean of counters a timed ray."""

    size: Size
    rays: dict[str, int]
    errors: Errors


class Pilot:
    """All candidates of a recommendation on one host; `requests` differ in the variant alone.

    `failed` says in a sentence why a variant cannot run, `same` which other's program and data a variant shares word
    for word: it is measured once.
    """

    def __init__(self, requests: Sequence[Request], host: Host) -> None:
        """Nothing is loaded yet."""
        self.requests = {request.variant.label: request for request in requests}
        self.host = host
        self.base = requests[0]
        self.failed: dict[str, str] = {}
        self.same: dict[str, str] = {}
        self.facts: dict[str, Facts] = {}
        self.frames = 0
        self.took_s = {"preparing": 0.0, "compiling": 0.0, "measuring": 0.0, "judging": 0.0}
        with self._preparing():
            self.scene = load(self.base.scene)
            self.device = host.device()
        self.clock: Clock = "cpu" if self.device.get("id") == "llvmpipe" and self.base.threads == 1 else "wall"
        self._trees: dict[tuple[str, str], Built] = {}
        self._prepared: OrderedDict[str, Prepared] = OrderedDict()
        self._arrays: WeakValueDictionary[str, Array] = WeakValueDictionary()
        self._digests: dict[int, tuple[ref[Array], str]] = {}
        self._plans: dict[str, Plan] = {}
        self._oracle: Oracle | None = None
        self._referee: Bvh | None = None

    def candidates(self, tell: Say) -> list[Candidate]:
        """Build and pack every variant once; those that can, each program with its data once."""
        found: list[Candidate] = []
        programs: dict[object, str] = {}
        told = 0.0
        for number, label in enumerate(self.requests):
            if time.monotonic() - told > TELL_S:
                told = time.monotonic()
                tell(f"preparing variant {number + 1} of {len(self.requests)}")
            try:
                ready = self._ready(label, tell)
                plan = self._made(ready, self.base.size)
            except (BuildError, PackError, PlanError) as error:
                self.failed[label] = str(error)
                continue
            first = programs.setdefault(self._program(plan), label)
            if first != label:
                self.same[label] = first
            else:
                found.append(Candidate(label, ready.packed.structure_bytes + ready.packed.primitives.nbytes))
        return found

    def measure(self, labels: Sequence[str], size: Size, frames: int = 1) -> Mapping[str, float | str]:
        """One round in the order given: seconds a frame, processor time where one thread of this machine is the GPU."""
        return {label: _spoken(partial(self._time, label, size, frames)) for label in labels}

    def judge(self, label: str, size: Size) -> Judged | str:
        """Run the instrumented plan and have its records judged."""
        return _spoken(partial(self._judge, label, size))

    # What takes time

    def _ready(self, label: str, tell: Say = silent) -> Prepared:
        if label in self._prepared:
            self._prepared.move_to_end(label)
            return self._prepared[label]
        with self._preparing():
            request = self.requests[label]
            ready = prepare(request, self.scene, self._built(request, tell))
            self._prepared[label] = replace(ready, packed=self._shared(ready.packed))
            while len(self._prepared) > 1 and sum(one.nbytes for one in self._arrays.values()) > MOST_BYTES:
                dropped, _ = self._prepared.popitem(last=False)
                self._forget(dropped)
        return self._prepared[label]

    def _built(self, request: Request, tell: Say) -> Built:
        """The tree, once for all variants that differ in what no builder looks at."""
        key = request.variant.structure, request.variant.builder
        if key not in self._trees:
            self._trees[key] = build_tree(self.scene, request, tell)
        return self._trees[key]

    def _plan(self, label: str, size: Size) -> Plan:
        plan = self._plans.get(label)
        if plan is None or plan.size != size:
            self._forget(label)
            plan = self._plans[label] = self._made(self._ready(label), size)
        return plan

    def _made(self, ready: Prepared, size: Size) -> Plan:
        """The timed plan at a size, its buffers shared with the others'."""
        with self._preparing():
            plan = _sized(ready, size).plan(instrument=False)
            return replace(
                plan,
                buffers=tuple(replace(one, data=self._shared(one.data)) for one in plan.buffers),
                textures=tuple(replace(one, data=self._shared(one.data)) for one in plan.textures),
            )

    def _forget(self, label: str) -> None:
        plan = self._plans.pop(label, None)
        if plan is not None and isinstance(self.host, KeptTwins):
            self.host.forget(plan)

    def _time(self, label: str, size: Size, frames: int) -> float:
        plan = self._plan(label, size)
        with holding(self.host.lock):
            begun = time.perf_counter()
            timed = self.host.measure(plan, frames, lambda: None)
            took = time.perf_counter() - begun
        refuse_cut(int((timed.image[..., 3] == 0).sum()))
        self.frames += frames
        self.took_s["measuring"] += sum(timed.frames.wall)
        self.took_s["compiling"] += max(0.0, took - sum(timed.frames.wall))
        return self._figure(timed.frames)

    def _figure(self, frames: Frames) -> float:
        """The fastest in processor time, to which neighbours only ever add; else the median."""
        return min(frames.cpu) if self.clock == "cpu" and frames.cpu else median(frames.wall)

    def _judge(self, label: str, size: Size) -> Judged:
        ready, plan = _sized(self._ready(label), size), self._plan(label, size)
        with holding(self.host.lock), self._timed("judging"):
            instrumented = ready.plan(instrument=True)
            records = records_of(ready, instrumented, self.host.collect(instrumented))
            timed = self.host.measure(plan, 1, lambda: None)
        with holding(machine_lock()), self._timed("judging"):
            refuse_apart(self.scene, records, self.base.rays, timed.image)
            intersector = ready.request.variant.intersector
            referee = self._tree_of_referee(ready)
            errors = judge(self.scene.triangles, records, self._embree(), referee, "referee", intersector)
        rays = {"primary": 0 if records.rasterised else len(records.primary), "shadow": len(records.shadow)}
        self.facts[label] = Facts(size, rays, errors)
        return Judged(wrong_rays(errors, self.base.rays), len(records.primary))

    def _embree(self) -> Oracle:
        if self._oracle is None:
            self._oracle = Oracle(self.scene.vertices, self.scene.faces)
        return self._oracle

    def _tree_of_referee(self, ready: Prepared) -> Bvh:
        if self._referee is None:
            self._referee = ready.referee_tree()
        return self._referee

    # Small parts

    @contextmanager
    def _preparing(self) -> Iterator[None]:
        with holding(machine_lock()), self._timed("preparing"):
            yield

    @contextmanager
    def _timed(self, part: str) -> Iterator[None]:
        begun = time.perf_counter()
        try:
            yield
        finally:
            self.took_s[part] += time.perf_counter() - begun

    def _shared(self, value: Any) -> Any:
        """The same dataclass with every array replaced by one of equal contents that is kept already."""
        if isinstance(value, np.ndarray):
            return self._arrays.setdefault(self._digest(value), value)
        if is_dataclass(value) and not isinstance(value, type):
            return replace(value, **{part.name: self._shared(getattr(value, part.name)) for part in fields(value)})
        return value

    def _digest(self, array: Array) -> str:
        """A digest of what an array holds, worked out once while it lives."""
        known = self._digests.get(id(array))
        if known is None or known[0]() is not array:
            digest = hashlib.blake2b(np.ascontiguousarray(array).data, digest_size=16)
            digest.update(repr((array.dtype.str, array.shape)).encode())
            known = self._digests[id(array)] = (ref(array), digest.hexdigest())
        return known[1]

    def _program(self, plan: Plan) -> object:
        """What tells plans apart: their texts and passes, and what their buffers hold."""
        held = [(one.name, one.nbytes, one.data is not None and self._digest(one.data)) for one in plan.buffers]
        held += [(one.name, one.texels, one.data is not None and self._digest(one.data)) for one in plan.textures]
        return plan.shader_sha, repr((plan.passes, plan.uniforms)), tuple(held)


def wrong_rays(errors: Errors, rays: str) -> float:
    """The fraction of wrong rays of the kind that is timed, of the worse kind with `both`; edges are not counted."""
    primary = (errors.false_hit or 0.0) + (errors.false_miss or 0.0) + (errors.wrong_primitive or 0.0)
    primary = max(primary, errors.raster_mismatch or 0.0)
    return primary if rays == "primary" else max(primary, errors.shadow_mismatch or 0.0)


def figures_of(pilot: Pilot, label: str, seconds: float) -> dict[str, Any]:
    """What is told of a finalist beside its time: rays a second of its clock, and its error as in a result."""
    facts, kind = pilot.facts[label], pilot.base.rays
    timed = (facts.rays["primary"] if kind != "shadow" else 0) + (facts.rays["shadow"] if kind != "primary" else 0)
    return {
        "frame_ms": seconds * 1e3,
        "mrays_per_s": timed / seconds / 1e6 if seconds else None,
        "error": {name: value for name, value in asdict(facts.errors).items() if name != "counts"},
    }


def _sized(ready: Prepared, size: Size) -> Prepared:
    return replace(ready, request=replace(ready.request, size=size))


def _spoken(work: Callable[[], Value]) -> Value | str:
    try:
        return work()
    except (BuildError, PackError, PlanError) as error:
        return str(error)
