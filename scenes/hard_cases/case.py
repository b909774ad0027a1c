"""What a hard case is: triangles, the rays to send at them, and what must hold beside being right."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

from scenes.scene import Camera, Scene

Floats = npt.NDArray[np.float32]
Doubles = npt.NDArray[np.float64]
Random = np.random.Generator
Expect = Literal["free", "blocked"]

FARTHEST = float(np.finfo(np.float32).max)
"""The reach of a ray that has no other."""


@dataclass(frozen=True, eq=False)
class Spawned:
    """Rays that start where the case's own rays hit, at the start that the variant's offset computes.

    `direction` (n, 3) float32 and `reach` (n,) float32 as given; `sided` turns each direction to the side of the hit
    triangle that its first ray came from. `expect` is what they must find: nothing before their reach ("free"), or
    something ("blocked"); None leaves that to the referee, and only hits on the triangle they left are counted.
    """

    direction: Floats
    reach: Floats
    expect: Expect | None = None
    sided: bool = True


@dataclass(frozen=True, eq=False)
class HardCase:
    """`triangles` (m, 3, 3) float32; rays by `origin`, `direction` (n, 3) and `reach` (n,) float32.

    `closed` says that every ray crosses a surface without holes, so that a miss is a hole, near an edge as well.
    `chain` asks for the deepest tree over the triangles in the order given, leftward or rightward.
    """

    triangles: Floats
    origin: Floats
    direction: Floats
    reach: Floats
    closed: bool = False
    chain: Literal["", "leftward", "rightward"] = ""
    spawned: Spawned | None = None

    def scene(self, name: str) -> Scene:
        """The triangles as a scene; its camera and light serve no ray."""
        corners = np.ascontiguousarray(self.triangles.reshape(-1, 3))
        faces = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
        return Scene(name, corners, faces, None, Camera((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), 60.0), ((0.0, 0.0, 0.0),))


Make = Callable[[Random, int], HardCase]


@dataclass(frozen=True)
class Family:
    """A kind of hard case: `make(random, count)` gives one with about `count` rays.

    `reason` is one sentence, `source` where it comes from. `bar` is the most CPU time a ray of it may take, as a
    multiple of an ordinary ray's in the same scene; None asks for nothing. `rays` is how many a whole study casts,
    `spawns` whether others start at their hits.
    """

    name: str
    reason: str
    source: str
    make: Make = field(repr=False)
    bar: float | None = None
    rays: int = 4096
    spawns: bool = False

    def case(self, seed: int, share: float = 1.0) -> HardCase:
        """The case of a seed, with `share` of the rays."""
        stream = np.random.default_rng([seed, *self.name.encode()])
        return self.make(stream, max(int(self.rays * share), 64))


def case(
    triangles: npt.ArrayLike,
    origin: npt.ArrayLike,
    direction: npt.ArrayLike,
    reach: npt.ArrayLike = FARTHEST,
    *,
    closed: bool = False,
    spawned: Spawned | None = None,
) -> HardCase:
    """A case of numbers of any precision, rounded to float32 here and nowhere else."""
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        start, way = (np.array(part, np.float32) for part in np.broadcast_arrays(origin, direction))
        limit = np.array(np.broadcast_to(np.asarray(reach, np.float32), len(start)))
        corners = np.ascontiguousarray(np.asarray(triangles, np.float32).reshape(-1, 3, 3))
    return HardCase(corners, start, way, limit, closed=closed, spawned=spawned)
