"""The axes of a recommendation: what is considered where nothing else is asked for."""

from __future__ import annotations

from renderer.variant import AXES, Variant

FIXED = ("layout", "intersector", "box", "precision", "offset", "builder")
"""Axes of which the default alone is considered unless others are asked for: they change what is computed, how long a
build takes, or, as the layout, little. Of every other axis all values are."""


def considered() -> dict[str, str]:
    """The values of each axis that are considered where nothing else is asked for."""
    usual = Variant().as_dict()
    return {axis: usual[axis] if axis in FIXED else "all" for axis in AXES}
