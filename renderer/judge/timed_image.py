"""Whether what is timed found what is judged: a compiler makes two programs of a text with counters and without.

A driver may spoil one and not the other (docs/adding_a_traversal.md names such a loop). So the picture of the timed
frames is held against what the instrumented run found, pixel by pixel.
"""

from __future__ import annotations

import numpy as np

from renderer.judge.shading import Image, distance_grey, dot, lit_grey, normals_of, picture, points_of
from renderer.plan import PlanError
from renderer.records import Flags, Records
from scenes.scene import Scene

LEVELS = 8
"""A pixel shows something else if a colour of 8 bits is off by more."""

MOST = 1e-3
"""The share of such pixels that may be edges, which two programs may round apart where the language lets them."""


class ApartError(PlanError):
    """Timed frames that show something else than what was judged."""


def refuse_apart(scene: Scene, records: Records, rays: str, image: Image) -> None:
    """Raise ApartError if more than MOST of a timed frame's pixels, (h, w, 4), are not as `records` have them."""
    apart = pixels_apart(scene, records, rays, image)
    if apart > MOST * records.hits.t.size:
        raise ApartError(
            f"{apart} of {records.hits.t.size} pixels of the timed frames show something else than the rays that were "
            "judged found, so the run does not count: this driver makes another program of what is timed; use another "
            "traversal or driver."
        )


def pixels_apart(scene: Scene, records: Records, rays: str, image: Image) -> int:
    """How many pixels of `image` are not as `records` have them; those that a rasteriser saw only where all is dark."""
    judged, known = _judged(scene, records, rays)
    off = np.abs(image[..., :3].astype(np.int16) - judged).max(axis=-1) > LEVELS
    return int((off.ravel() & known).sum())


def _judged(scene: Scene, records: Records, rays: str) -> tuple[Image, Flags]:
    """The picture that the records make, (h, w, 3), and which pixels it is known of, (h*w,)."""
    hits = records.hits
    hit = hits.primitive != -1
    known = np.ones(len(hit), np.bool_)
    t = hits.t[hit].astype(np.float64)
    if rays == "primary":
        return picture(records.size, hit, distance_grey(scene, t)), known
    clear = ~records.occluded
    light = np.zeros(len(hit))
    if records.rasterised:
        known[records.shadow_pixel[clear]] = False
    else:
        normal = np.zeros((len(hit), 3))
        primary = records.primary[np.flatnonzero(hit)]
        _, normal[hit] = normals_of(scene, primary, points_of(primary, t), hits.primitive[hit])
        given = np.maximum(dot(normal[records.shadow_pixel], records.shadow.direction), 0.0)
        np.add.at(light, records.shadow_pixel, given * clear)
    return picture(records.size, hit, lit_grey(scene, light[hit])), known
