"""The one way in: what a request's traversal, layout and shading read, laid out in buffers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from renderer.build.tree import Bvh, Tree
from renderer.pack.baked import bake
from renderer.pack.nodes import PackedNodes, pack_nodes
from renderer.pack.primitives import PackedPrimitives, face_normals, pack_primitives
from renderer.request import Request
from renderer.variant import TRAVERSALS
from scenes.scene import Scene


@dataclass(frozen=True, eq=False)
class Packed:
    """The buffers of one request: nodes and primitives, what shading needs of normals, and their sizes in bytes."""

    nodes: PackedNodes | None
    primitives: PackedPrimitives
    normals: bool

    @property
    def structure_bytes(self) -> int:
        """The bytes of nodes and triangle lists."""
        return 0 if self.nodes is None else self.nodes.words.nbytes


def pack(scene: Scene, tree: Tree | None, request: Request) -> Packed:
    """Lay out what the request's traversal, layout and shading read."""
    variant = request.variant
    corner_normals = _corner_normals(scene, request)
    order = tree.order if isinstance(tree, Bvh) else None
    return Packed(
        None if tree is None else pack_nodes(tree, TRAVERSALS[variant.traversal].nodes, variant.nodes),
        _primitives(scene, corner_normals, order, request),
        corner_normals is not None,
    )


def _primitives(
    scene: Scene, corner_normals: npt.NDArray[np.float32] | None, order: npt.NDArray[np.int32] | None, request: Request
) -> PackedPrimitives:
    packed = pack_primitives(scene.triangles, corner_normals, order, request.variant.layout)
    if request.variant.intersector != "baked":
        return packed
    return replace(packed, baked=bake(scene.triangles, order))


def _corner_normals(scene: Scene, request: Request) -> npt.NDArray[np.float32] | None:
    """Normals for the primitive buffers: in the general form always, else if the rays' shading reads them."""
    if not request.specialise:
        if scene.normals is None:
            flat = face_normals(scene.triangles).astype(np.float32)
            return np.repeat(flat[:, None], 3, axis=1)
        return scene.normals[scene.faces]
    if scene.normals is None or request.variant.method == "hybrid":
        return None
    return scene.normals[scene.faces]
