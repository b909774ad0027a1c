"""Heatmaps side by side as one PNG with one scale, as the paper's Figure 8 shows them."""

from __future__ import annotations

import math
import textwrap
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, StrMethodFormatter

from renderer.pictures.counts import Counts
from renderer.pictures.heatmap import summarise

COLOURS = "inferno"
"""Perceptually uniform, and dark to light in grey too."""

ABOVE = "#35e0ff"
"""Counts above the scale: a colour that the map does not have."""

PANEL = 4.2
"""The longer side of a map in inches."""

PIXELS = (420, 1024)
"""A map is drawn at least and at most this many pixels long; within them each of its pixels gets whole ones."""

MARGIN, GAP, CAPTION, SCALE = 0.3, 0.3, 0.62, 0.95
LINE = 0.24
TITLE_SIZE, TEXT_SIZE = 12.0, 9.5
GLYPH = 0.6
"""The width of a letter as a fraction of its size, on the safe side."""


@dataclass(frozen=True, eq=False)
class Panel:
    """One map: its title, and counts (h, w), row 0 at the bottom."""

    title: str
    counts: Counts


def common_scale(maps: Sequence[Counts]) -> int:
    """The top of one scale for all maps: the largest of their 99.5th percentiles, rounded up to two digits."""
    top = max(1.0, *(float(np.percentile(counts, 99.5)) for counts in maps))
    step: int = 10 ** max(math.floor(math.log10(top)) - 1, 0)
    return math.ceil(top / step) * step


def draw(panels: Sequence[Panel], path: Path, title: Sequence[str], label: str, top: int | None = None) -> int:
    """Write panels of one shape to a PNG, `title` in lines above; `label` says what is counted. Return the scale's top.

    The scale goes from 0 to `top`, by default `common_scale`; counts above it have a colour of their own.
    """
    chosen = common_scale([panel.counts for panel in panels]) if top is None else top
    norm, colours = Normalize(0, chosen), colormaps[COLOURS].with_extremes(over=ABOVE)
    sheet = _Sheet(len(panels), panels[0].counts.shape, title)
    for i, line in enumerate(sheet.title):
        sheet.write(MARGIN, MARGIN + i * LINE, line, TITLE_SIZE, weight="bold" if i == 0 else "normal")
    for i, panel in enumerate(panels):
        _draw_panel(sheet, i, panel, colours, norm)
    _draw_scale(sheet, panels, label, colours, norm)
    with warnings.catch_warnings():
        # A scene's name may have letters that the font lacks; they become boxes.
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        FigureCanvasAgg(sheet.figure)
        sheet.figure.savefig(path, format="png")
    return chosen


class _Sheet:
    """The figure, and where things lie on it in inches from the top left."""

    def __init__(self, count: int, shape: tuple[int, ...], title: Sequence[str]) -> None:
        rows, columns = shape
        longer = max(rows, columns)
        self.across = count if count <= 3 else math.ceil(math.sqrt(count))
        self.panel_width = max(PANEL * columns / longer, PANEL * 0.8)
        self.panel_height = max(PANEL * rows / longer, PANEL * 0.2)
        self.width = 2 * MARGIN + self.across * self.panel_width + (self.across - 1) * GAP
        letters = int((self.width - 2 * MARGIN) * 72 / (TITLE_SIZE * GLYPH))
        self.title = [part for line in title for part in textwrap.wrap(line, letters)]
        self.first = MARGIN + LINE * len(self.title)
        down = math.ceil(count / self.across)
        self.height = self.first + down * (self.panel_height + CAPTION) + SCALE
        fewest, most = PIXELS
        self.dpi = min(longer * math.ceil(fewest / longer), most) / PANEL
        self.figure = Figure((self.width, self.height), self.dpi, facecolor="white")

    def panel(self, index: int) -> tuple[float, float]:
        """The left and top of a map; its caption stands above it."""
        row, column = divmod(index, self.across)
        left = MARGIN + column * (self.panel_width + GAP)
        return left, self.first + row * (self.panel_height + CAPTION) + CAPTION

    def box(self, left: float, top: float, width: float, height: float) -> tuple[float, float, float, float]:
        """A box as matplotlib takes it: fractions, from the bottom left."""
        return left / self.width, 1 - (top + height) / self.height, width / self.width, height / self.height

    def write(self, left: float, top: float, text: str, size: float, weight: str = "normal") -> None:
        """Write one line; `$` and the like mean nothing in it."""
        x, y, _, _ = self.box(left, top, 0, 0)
        self.figure.text(x, y, text, fontsize=size, weight=weight, va="top", parse_math=False)


def _draw_panel(sheet: _Sheet, i: int, panel: Panel, colours: Colormap, norm: Normalize) -> None:
    left, top = sheet.panel(i)
    axes = sheet.figure.add_axes(sheet.box(left, top, sheet.panel_width, sheet.panel_height))
    smooth = max(panel.counts.shape) > PIXELS[1]
    axes.imshow(panel.counts, colours, norm, origin="lower", interpolation="antialiased" if smooth else "nearest")
    axes.set_anchor("NW")
    axes.set_axis_off()
    sheet.write(left, top - CAPTION + 0.16, panel.title, TEXT_SIZE + 1, weight="bold")
    sheet.write(left, top - CAPTION + 0.38, summarise(panel.counts).text, TEXT_SIZE)


def _draw_scale(sheet: _Sheet, panels: Sequence[Panel], label: str, colours: Colormap, norm: Normalize) -> None:
    clipped = any(panel.counts.max() > norm.vmax for panel in panels)
    width = min(sheet.width - 2 * MARGIN, 2 * PANEL)
    axes = sheet.figure.add_axes(sheet.box(MARGIN, sheet.height - SCALE + 0.22, width, 0.17))
    bar = sheet.figure.colorbar(
        ScalarMappable(norm, colours),
        cax=axes,
        orientation="horizontal",
        extend="max" if clipped else "neither",
        extendfrac=0.03,
        ticks=MaxNLocator(integer=True),
        format=StrMethodFormatter("{x:,.0f}"),
    )
    bar.ax.tick_params(labelsize=TEXT_SIZE)
    above = f"; blue: above {norm.vmax:,.0f}" if clipped else ""
    bar.set_label(label + above, fontsize=TEXT_SIZE)
