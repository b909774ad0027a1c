"""Pictures as PNG: counts by the heatmap's colours, signed differences on a scale around grey, images apart."""

from __future__ import annotations

import io
from functools import cache

import numpy as np
from PIL import Image, ImageColor

from server.pictures.figures import blocks, image_difference, require_same_size
from server.pictures.stored import Counts, Pixels

STEPS = 255
"""Colours of a scale; the palette's last one stands for what is above it."""
DIVERGING = "RdBu_r"
"""matplotlib's map for differences: blue below 0, red above."""
EFFORT = 3
"""Of zlib; more takes twice as long for a few per cent."""

Stop = tuple[float, str]


def paint_counts(counts: Counts, top: int) -> bytes:
    """A heatmap of counts (h, w), the top row first, from 0 to `top`; above it the heatmap's colour for that."""
    steps = np.empty(counts.shape, np.uint8)
    for rows in blocks(counts):
        part = counts[rows].astype(np.uint64)
        steps[rows] = np.where(part > top, STEPS, part * (STEPS - 1) // top)
    return _paletted(steps, _heat())


def paint_change(baseline: Counts, against: Counts, top: int) -> bytes:
    """`against` minus `baseline`, from -`top` to `top`; what is beyond has the colours of the ends."""
    require_same_size(baseline, against)
    steps = np.empty(baseline.shape, np.uint8)
    middle = STEPS // 2
    for rows in blocks(baseline):
        change = against[rows].astype(np.int64) - baseline[rows]
        steps[rows] = middle + np.rint(np.clip(change / top, -1, 1) * middle).astype(np.int64)
    return _paletted(steps, _diverging())


def paint_image_change(baseline: Pixels, against: Pixels, factor: int) -> bytes:
    """The absolute difference per channel, `factor` times as bright."""
    require_same_size(baseline, against)
    apart = image_difference(baseline, against)
    for rows in blocks(apart):
        apart[rows] = np.minimum(apart[rows].astype(np.uint16) * factor, 255)
    return _png(Image.fromarray(apart))


def shrink(png: bytes, width: int) -> bytes:
    """A PNG no wider than `width` pixels."""
    with Image.open(io.BytesIO(png), formats=("PNG",)) as image:
        if image.width <= width:
            return png
        height = max(1, round(image.height * width / image.width))
        return _png(image.convert("RGB").resize((width, height), Image.Resampling.BOX))


def heat_stops(count: int = 17) -> list[Stop]:
    """The heatmap's colours along its scale, (0 to 1, `#rrggbb`)."""
    return _stops(_heat(), count)


def change_stops(count: int = 17) -> list[Stop]:
    """The colours of differences along their scale."""
    return _stops(_diverging(), count)


@cache
def _heat() -> bytes:
    from renderer.pictures.heatmap_picture import ABOVE, COLOURS

    return _palette(COLOURS) + bytes(ImageColor.getrgb(ABOVE)[:3])


@cache
def _diverging() -> bytes:
    return _palette(DIVERGING)


def _palette(name: str) -> bytes:
    from matplotlib import colormaps

    colours = colormaps[name](np.linspace(0, 1, STEPS), bytes=True)
    return np.ascontiguousarray(colours[:, :3]).tobytes()


def _stops(palette: bytes, count: int) -> list[Stop]:
    at = [round(i * (STEPS - 1) / (count - 1)) for i in range(count)]
    return [(i / (STEPS - 1), f"#{palette[3 * i : 3 * i + 3].hex()}") for i in at]


def _paletted(steps: Pixels, palette: bytes) -> bytes:
    image = Image.fromarray(steps)
    image.putpalette(palette)
    return _png(image)


def _png(image: Image.Image) -> bytes:
    out = io.BytesIO()
    image.save(out, "png", compress_level=EFFORT)
    return out.getvalue()
