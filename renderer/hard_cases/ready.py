"""A family's case made ready: its scene, its trees, the referee's answers, all of them made once."""

from __future__ import annotations

import os
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import numpy as np

from renderer.build.api import build
from renderer.build.chain import chain_bvh
from renderer.build.tree import Builder, Bvh, Tree
from renderer.judge import referee
from renderer.judge.court import Court
from renderer.judge.referee import Verdict
from renderer.ray_plan import Answer
from renderer.records import Rays
from renderer.variant import Variant
from scenes.hard_cases import Family, HardCase
from scenes.hard_cases.shapes import about
from scenes.scene import Scene

ORDINARY = 2048
"""Ordinary rays that a family's cost is measured against, and as many of its own."""


class Ready:
    """One family's case. Building may raise BuildError, at the first use of the tree and at every other."""

    def __init__(self, family: Family, seed: int, share: float = 1.0, folder: Path | None = None) -> None:
        """Make the case of a seed with a share of the rays."""
        self._folder = folder
        self.family, self.seed = family, seed
        self.case: HardCase = family.case(seed, share)
        self.scene: Scene = self.case.scene(family.name)
        self.rays = Rays(self.case.origin, self.case.direction, self.case.reach)
        self.references: dict[str, Answer | None] = {}
        self._trees: dict[tuple[Any, str], Tree] = {}

    def tree(self, variant: Variant) -> Tree | None:
        """The structure that a variant walks."""
        kind = variant.structure
        if kind == "none":
            return None
        if self.case.chain and kind == "bvh":
            return self._chain
        builder = cast(Builder, variant.builder)
        if (kind, builder) not in self._trees:
            self._trees[kind, builder] = build(self.scene.key, self.scene.triangles, kind, builder)[0]
        return self._trees[kind, builder]

    @cached_property
    def truth(self) -> Verdict:
        """The referee's closest hits, kept in `folder` for the other processes of a study."""
        file = self._folder / f"{self.family.name}.npz" if self._folder else None
        if file is not None and file.exists():
            with np.load(file) as known:
                return Verdict(known["t"], known["primitive"])
        verdict = referee.closest(self.scene.triangles, self.rays, self._referee_tree)
        if file is not None:
            part = file.with_suffix(f".{os.getpid()}.part")
            with part.open("wb") as out:
                np.savez(out, t=verdict.t, primitive=verdict.primitive)
            part.replace(file)
        return verdict

    def court(self, intersector: str) -> Court:
        """Who judges an intersector's answers."""
        return Court(self.scene.triangles, None, self._referee_tree, True, intersector)

    @cached_property
    def ordinary(self) -> Rays:
        """Ordinary rays in the same scene, and always the same."""
        corners = self.scene.triangles.astype(np.float64)
        origin, direction = about(np.random.default_rng(self.seed), corners, ORDINARY)
        reach = np.full(ORDINARY, np.finfo(np.float32).max, np.float32)
        with np.errstate(over="ignore"):
            return Rays(origin.astype(np.float32), direction.astype(np.float32), reach)

    @property
    def finite(self) -> bool:
        """Whether every coordinate is a number."""
        return bool(np.isfinite(self.scene.triangles).all())

    @cached_property
    def _chain(self) -> Bvh:
        return chain_bvh(self.scene.triangles, rightward=self.case.chain == "rightward")

    @cached_property
    def _referee_tree(self) -> Bvh | None:
        if not self.finite or len(self.scene.faces) < 64:
            return None
        tree = self.tree(Variant("bvh-stack", "compute"))
        assert isinstance(tree, Bvh)
        return tree
