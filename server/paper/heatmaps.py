"""Figure 8: nodes traversed per pixel, all traversals on one scale."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib import colormaps
from matplotlib.colors import to_rgb
from PIL import Image

from renderer.pictures.counts import Counts
from renderer.pictures.files import PictureError, read_counts
from renderer.pictures.heatmap import summarise
from renderer.pictures.heatmap_picture import ABOVE, COLOURS, common_scale
from renderer.request import MAX_SIDE
from server.paper.data import TRAVERSALS, Cell, Section
from server.paper.roles import FAIRY, scene_for

Pictures = Callable[[str], bytes | None]
"""Gives a stored picture by its sha256, None where it is not there."""

SMALLEST = 256
"""A map is enlarged by whole pixels to at least so many."""
STEPS = 256
THUMBNAIL = 240


@dataclass(frozen=True)
class Heatmap:
    """One map as an address that holds the PNG itself, and its figures in words."""

    traversal: str
    image: str
    text: str


@dataclass(frozen=True)
class Heatmaps:
    """Maps of one scene on one scale from 0 to `top` nodes; `above` says whether some pixels are above it."""

    scene: str
    size: tuple[int, int]
    maps: tuple[Heatmap, ...]
    scale: str
    top: int
    above: bool
    missing: tuple[str, ...]


def heatmaps(section: Section, pictures: Pictures) -> Heatmaps | str:
    """The maps of the forest, or of the most complex scene; or one sentence why there are none."""
    scene = scene_for(section.scenes, FAIRY) or list(section.scenes)[-1]
    found = {name: _counts(section, Cell(scene, name), pictures) for name in TRAVERSALS}
    counts = {name: each for name, each in found.items() if each is not None}
    if not counts:
        return f"No counts per pixel of {scene} are kept with these results."
    shape = next(iter(counts.values())).shape
    counts = {name: each for name, each in counts.items() if each.shape == shape}
    top = common_scale(list(counts.values()))
    return Heatmaps(
        scene=scene,
        size=(shape[1], shape[0]),
        maps=tuple(Heatmap(name, _image(_coloured(each, top)), summarise(each).text) for name, each in counts.items()),
        scale=_image(_coloured(np.linspace(0, top, STEPS)[None], top)),
        top=top,
        above=any(int(each.max()) > top for each in counts.values()),
        missing=tuple(name for name in TRAVERSALS if name not in counts),
    )


def rendered(section: Section, scene: str, pictures: Pictures) -> str | None:
    """A scene's rendered picture, made small, as an address that holds it; None where none is kept."""
    for cell, document in section.documents.items():
        name = _picture(document, "image") if cell.scene == scene else None
        data = pictures(name) if name else None
        if data is not None:
            return _thumbnail(data)
    return None


def _thumbnail(data: bytes) -> str | None:
    try:
        with Image.open(io.BytesIO(data), formats=["PNG"]) as image:
            if max(image.size) > MAX_SIDE:
                return None
            small = image.convert("RGB")
    except (OSError, ValueError, SyntaxError):
        return None
    small.thumbnail((THUMBNAIL, THUMBNAIL))
    out = io.BytesIO()
    small.save(out, "png", optimize=True)
    return _address(out.getvalue())


def _counts(section: Section, cell: Cell, pictures: Pictures) -> Counts | None:
    name = _picture(section.documents.get(cell) or {}, "counts")
    data = pictures(name) if name else None
    if data is None:
        return None
    try:
        return read_counts(data)["nodes"]
    except PictureError:
        return None


def _picture(document: dict[str, Any], kind: str) -> str | None:
    held = document.get("pictures")
    name = held.get(kind) if isinstance(held, dict) else None
    return name if isinstance(name, str) else None


def _coloured(counts: npt.NDArray[Any], top: int) -> npt.NDArray[np.uint8]:
    """Counts as colours, (h, w, 3), the top row first."""
    colours = colormaps[COLOURS](np.clip(counts / top, 0, 1))[..., :3]
    colours[counts > top] = to_rgb(ABOVE)
    found: npt.NDArray[np.uint8] = np.rint(colours * 255).astype(np.uint8)[::-1]
    return found


def _image(pixels: npt.NDArray[np.uint8]) -> str:
    factor = -(-SMALLEST // max(pixels.shape[:2]))
    image = Image.fromarray(np.ascontiguousarray(pixels))
    out = io.BytesIO()
    image.resize((image.width * factor, image.height * factor), Image.Resampling.NEAREST).save(
        out, "png", optimize=True
    )
    return _address(out.getvalue())


def _address(png: bytes) -> str:
    return f"data:image/png;base64,{base64.b64encode(png).decode()}"
