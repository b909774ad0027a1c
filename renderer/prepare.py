"""A request made ready: its scene, its tree from the cache, its buffers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

from renderer.answering import Say, silent
from renderer.build.api import build
from renderer.build.tree import Builder, Bvh, SahCosts, Tree
from renderer.kept_packed import kept_packed
from renderer.pack.api import Packed, pack
from renderer.plan import Plan
from renderer.planner import Reads, make_plan
from renderer.request import Request
from scenes.load import load
from scenes.scene import Scene


@dataclass(frozen=True, eq=False)
class Prepared:
    """Everything that a host and the judges need of one request; `build_ms` is the tree's CPU time."""

    request: Request
    scene: Scene
    tree: Tree | None
    build_ms: float | None
    packed: Packed

    def plan(self, *, instrument: bool) -> Plan:
        """The timed plan, or the instrumented one."""
        return make_plan(self.scene, self.tree, self.packed, self.request, instrument=instrument)

    def recording_plan(self, reads: Reads) -> Plan:
        """The timed plan, made to record what it reads."""
        return make_plan(self.scene, self.tree, self.packed, self.request, reads=reads)

    def referee_tree(self) -> Bvh:
        """A BVH of whole triangles for the referee to walk, whatever the request's own structure is."""
        if isinstance(self.tree, Bvh) and len(self.tree.order) == len(self.scene.faces):
            return self.tree
        tree, _ = build(self.scene.key, lambda: self.scene.triangles, "bvh", "sah", SahCosts())
        assert isinstance(tree, Bvh)
        return tree


Built = tuple[Tree | None, float | None]
"""A tree and the CPU milliseconds of its build."""


def prepare(request: Request, scene: Scene | None = None, built: Built | None = None, note: Say = silent) -> Prepared:
    """Load, build and pack; raise SceneError, BuildError or PackError with one sentence.

    `scene` and `built` are the request's own where they are at hand; `note` hears how far a long build is.
    """
    scene = scene or load(request.scene)
    tree, build_ms = built or build_tree(scene, request, note)
    return Prepared(request, scene, tree, build_ms, pack(scene, tree, request))


def prepare_again(request: Request, note: Say = silent) -> Prepared:
    """`prepare` for what other processes prepare too: what is packed is kept on disk."""
    scene = load(request.scene)
    tree, build_ms = build_tree(scene, request, note)
    packed = kept_packed(scene, request, lambda: pack(scene, tree, request))
    return Prepared(request, scene, tree, build_ms, packed)


def build_tree(scene: Scene, request: Request, note: Say = silent) -> Built:
    """The request's tree, from the cache where it is there."""
    kind = request.variant.structure
    if kind == "none":
        return None, None
    builder = cast(Builder, request.variant.builder)
    return build(scene.key, lambda: scene.triangles, kind, builder, request.costs, note)
