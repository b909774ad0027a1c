"""Hit records: the rays that a host cast and what it found, as the instrumented plan reports them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int32]
Words = npt.NDArray[np.uint32]
Flags = npt.NDArray[np.bool_]

COUNTERS = ("nodes", "inner", "leaves", "triangles", "words")
"""What an instrumented traversal counts per ray; `words` are 4-byte words fetched from storage buffers."""

RASTERISED = -2
"""The primitive of a hit that a rasteriser found: which one is not known."""


@dataclass(frozen=True, eq=False)
class Rays:
    """n rays as cast: `origin`, `direction` (n, 3) float32; `reach` (n,) float32, the largest t that counts."""

    origin: Floats
    direction: Floats
    reach: Floats

    def __len__(self) -> int:
        """The number of rays."""
        return len(self.origin)

    def __getitem__(self, index: npt.NDArray[np.generic] | slice) -> Rays:
        """The rays that `index` selects."""
        return Rays(self.origin[index], self.direction[index], self.reach[index])


@dataclass(frozen=True, eq=False)
class Hits:
    """The closest hit of n rays: `t` (n,) float32, inf for a miss; `primitive` (n,) int32, -1 for a miss.

    For a hybrid plan, whose primary hits come from the rasteriser, `primitive` is RASTERISED where something was hit.
    """

    t: Floats
    primitive: Ints


@dataclass(frozen=True, eq=False)
class Records:
    """Everything an instrumented run of one image reports; pixels in row order, row 0 at the bottom.

    `primary` and `hits` have w*h entries. `shadow` holds the shadow rays actually cast, `shadow_pixel` (s,) int32 the
    pixel and `shadow_light` (s,) int32 the light of each, `occluded` (s,) bool what was found. `primary_counts` is
    (w*h, 5) and `shadow_counts` (s, 5) uint32 in the order of COUNTERS. `cut` (w*h,) bool marks pixels whose loops
    were stopped before they were done. `rasterised` says that no primary ray was cast: `primary` are then the rays
    that would have been, and `hits` what the rasteriser saw.
    """

    size: tuple[int, int]
    primary: Rays
    hits: Hits
    shadow: Rays
    shadow_pixel: Ints
    shadow_light: Ints
    occluded: Flags
    primary_counts: Words
    shadow_counts: Words
    cut: Flags
    rasterised: bool = False
