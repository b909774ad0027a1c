"""Asks a device questions, one program for all of a variant's questions of the general form."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from renderer.build.tree import Tree
from renderer.hard_cases.ready import Ready
from renderer.pack.api import Packed, pack
from renderer.plan import Plan
from renderer.ray_plan import Answer, Question, make_ray_plan, read_answer
from renderer.records import Hits, Rays
from renderer.request import Request
from renderer.twin import Twin, open_context
from renderer.variant import Variant

TRIES = 3
"""Timed frames, of which the fastest counts."""

KEPT = 3
"""Variants whose programs are kept: the one in turn, and the one that others are compared with."""


class Asker:
    """One EGL context, and the programs of the variants that were last in turn."""

    def __init__(self, context: Any = None) -> None:
        """Open a context, unless one is given."""
        self._context = context or open_context()
        self._kept: dict[Variant, dict[str, Any]] = {}

    def set_up(self, variant: Variant, ready: Ready, *, fitted: bool = False) -> Setup:
        """Lay a case out for a variant; raise BuildError or PackError where that cannot be."""
        request = Request(ready.scene.name, variant, (8, 8), specialise=fitted)
        tree = ready.tree(variant)
        with np.errstate(all="ignore"):
            return Setup(self, ready, request, tree, pack(ready.scene, tree, request))

    def run(self, variant: Variant, plan: Plan, count: int) -> Answer:
        """The answer to a plan's `count` rays."""
        twin = Twin(self._context, plan, self._programs(variant))
        try:
            return read_answer(plan, count, twin.collect())
        finally:
            twin.release()

    def cpu_s(self, variant: Variant, plan: Plan) -> float:
        """The least CPU seconds of some frames, all threads; the first is dropped."""
        twin = Twin(self._context, plan, self._programs(variant))
        try:
            twin.frame()
            return min(twin.time_frames(TRIES).cpu)
        finally:
            twin.release()

    def _programs(self, variant: Variant) -> dict[str, Any]:
        programs = self._kept.pop(variant, {})
        self._kept[variant] = programs
        while len(self._kept) > KEPT:
            for program in self._kept.pop(next(iter(self._kept))).values():
                program.release()
        return programs


class Setup:
    """A case laid out for a variant."""

    def __init__(self, asker: Asker, ready: Ready, request: Request, tree: Tree | None, packed: Packed) -> None:
        """Keep what a question needs."""
        self.tree = tree
        self._asker, self._ready, self._request, self._packed = asker, ready, request, packed

    def ask(self, rays: Rays, *, any_hit: bool = False) -> Answer:
        """The closest hits of rays, or any."""
        return self._run(Question(rays, any_hit))

    def spawn(self, first: Answer, index: Any, spawned: Rays) -> Answer:
        """The closest hits of rays that start at the hits that `index` selects of a first answer."""
        rays, found = self._ready.rays[index], Hits(first.hits.t[index], first.hits.primitive[index])
        return self._run(Question(rays, start=found, slot=first.slot[index], spawned=spawned))

    def seconds_per_ray(self, rays: Rays) -> float:
        """CPU seconds a ray."""
        return self._asker.cpu_s(self._request.variant, self._plan(Question(rays))) / len(rays)

    def _run(self, question: Question) -> Answer:
        answer = self._asker.run(self._request.variant, self._plan(question), len(question.rays))
        reach = question.rays.reach if question.spawned is None else question.spawned.reach
        return replace(answer, rays=Rays(answer.rays.origin, answer.rays.direction, reach))

    def _plan(self, question: Question) -> Plan:
        return make_ray_plan(self._ready.scene, self.tree, self._packed, self._request, question)
