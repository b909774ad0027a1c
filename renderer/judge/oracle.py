"""The first judge of hit records: Embree through embreex, in robust mode, over the very rays that a host cast."""

from __future__ import annotations

from typing import Any

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from renderer.records import Flags, Floats, Hits, Ints, Rays


class Oracle:
    """Embree's answers for one scene; `t` is in units of the direction, which need not have length 1.

    Embree's interval is [0, reach] while ours is (0, reach]: a ray that starts on a surface hits it at t = 0 here.
    A ray with a NaN or an infinity in origin or direction misses. Tracing uses the calling thread only.
    """

    def __init__(self, vertices: Floats, faces: Ints | None = None) -> None:
        """Build from `vertices` (n, 3) with `faces` (m, 3), or from triangles (m, 3, 3) alone.

        float32 with int32 faces goes into Embree without another copy in Python and twice as fast as triangles do.
        """
        _check(vertices, faces)
        self._scene = EmbreeScene(robust=True)
        if len(vertices if faces is None else faces):
            TriangleMesh(self._scene, vertices, faces)
        # embreex builds its tree on first use, which is nobody's frame.
        self._scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))

    def closest(self, rays: Rays) -> Hits:
        """The closest hit of every ray within its reach."""
        # embreex writes the hit distances into `dists`, so it gets an array of its own.
        found: dict[str, Any] = self._scene.run(
            rays.origin, rays.direction, dists=rays.reach.copy(), query="INTERSECT", output=True
        )
        primitive: Ints = found["primID"]
        return Hits(np.where(primitive >= 0, found["tfar"], np.float32(np.inf)), primitive)

    def occluded(self, rays: Rays) -> Flags:
        """Whether anything lies on each ray within its reach, (n,) bool."""
        return self.trace_occluded(rays) >= 0

    def trace_closest(self, rays: Rays) -> Ints:
        """`closest` for benchmarks: one call of Embree's loop, the primitives only, (n,) int32, -1 for a miss."""
        primitive: Ints = self._scene.run(rays.origin, rays.direction, dists=rays.reach, query="INTERSECT")
        return primitive

    def trace_occluded(self, rays: Rays) -> Ints:
        """`occluded` for benchmarks: one call of Embree's loop, (n,) int32, -1 where the way is free."""
        geometry: Ints = self._scene.run(rays.origin, rays.direction, dists=rays.reach, query="OCCLUDED")
        return geometry


def _check(vertices: Floats, faces: Ints | None) -> None:
    """Refuse shapes that embreex would read out of bounds."""
    shape = (3,) if faces is not None else (3, 3)
    if vertices.shape[1:] != shape or (faces is not None and faces.shape[1:] != (3,)):
        raise ValueError("Give the oracle triangles (m, 3, 3), or vertices (n, 3) with faces (m, 3).")
    if faces is not None and len(faces) and not 0 <= int(faces.min()) <= int(faces.max()) < len(vertices):
        raise ValueError("A face names a vertex that is not there; check the faces before asking the oracle.")
