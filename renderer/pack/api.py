"""The one way in: what a request's traversal, layout and shading read, laid out in buffers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from renderer.build.tree import MAX_DEPTH, Bvh, Tree, WideBvh
from renderer.pack.baked import bake
from renderer.pack.nodes import PackedNodes, pack_nodes
from renderer.pack.primitives import Corners, PackedPrimitives, face_normals, pack_primitives
from renderer.pack.schema import NODE_LAYOUTS
from renderer.request import Request
from renderer.variant import TRAVERSALS
from scenes.scene import Scene

Ints = npt.NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Packed:
    """The buffers of one request: nodes and primitives, what shading needs of normals, and their sizes in bytes.

    `levels` is what a stack or a trail must hold of the tree as it is walked, `most_levels` of any tree.
    """

    nodes: PackedNodes | None
    primitives: PackedPrimitives
    normals: bool
    levels: int = 0
    most_levels: int = MAX_DEPTH

    @property
    def structure_bytes(self) -> int:
        """The bytes of nodes and triangle lists."""
        return 0 if self.nodes is None else self.nodes.words.nbytes


def pack(scene: Scene, tree: Tree | None, request: Request) -> Packed:
    """Lay out what the request's traversal, layout and shading read."""
    normals = _normals(scene, request)
    walked = _as_walked(tree, request)
    order = walked.order if isinstance(walked, Bvh | WideBvh) else None
    primitives = _primitives(scene, normals, order, request)
    if walked is None:
        return Packed(None, primitives, normals is not None)
    nodes = pack_nodes(walked, TRAVERSALS[request.variant.traversal].nodes, request.variant.nodes)
    if isinstance(walked, WideBvh):
        return Packed(nodes, primitives, normals is not None, walked.waiting, (walked.width - 1) * MAX_DEPTH)
    return Packed(nodes, primitives, normals is not None, walked.depth)


def _as_walked(tree: Tree | None, request: Request) -> Tree | WideBvh | None:
    """The tree, collapsed for a traversal that walks wide nodes."""
    wide = tree is not None and NODE_LAYOUTS[TRAVERSALS[request.variant.traversal].nodes]["f32"].order == "quads"
    if not wide:
        return tree
    # Narrow trees need no compiler.
    from renderer.build.wide import collapse

    assert isinstance(tree, Bvh)
    return collapse(tree, request.costs)


def _primitives(scene: Scene, normals: Corners | None, order: Ints | None, request: Request) -> PackedPrimitives:
    packed = pack_primitives(Corners(scene.vertices, scene.faces), normals, order, request.variant.layout)
    if request.variant.intersector != "baked":
        return packed
    return replace(packed, baked=bake(scene.triangles, order))


def _normals(scene: Scene, request: Request) -> Corners | None:
    """Normals for the primitive buffers: in the general form always, else if the rays' shading reads them."""
    if scene.normals is not None:
        unread = request.specialise and request.variant.method == "hybrid"
        return None if unread else Corners(scene.normals, scene.faces)
    if request.specialise:
        return None
    flat = face_normals(scene.triangles).astype(np.float32)
    return Corners(flat, np.broadcast_to(np.arange(len(flat), dtype=np.int32)[:, None], (len(flat), 3)))
