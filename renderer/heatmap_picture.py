"""Heatmaps side by side as one PNG with one scale, as the paper's Figure 8 shows them."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, Normalize
from matplotlib.figure import Figure

from renderer.heatmap import Counts, summarise

COLOURS = "inferno"
"""Perceptually uniform, and dark to light in grey too."""

ABOVE = "#35e0ff"
"""Counts above the scale: a colour that the map does not have."""

PANEL_INCHES = 4.2
FEWEST_PIXELS = 420
"""A map is drawn at this many pixels or more, each of its own pixels a whole number of them."""

MARGIN, GAP, TITLE, CAPTION, SCALE = 0.3, 0.3, 0.55, 0.6, 0.85


@dataclass(frozen=True, eq=False)
class Panel:
    """One map: its title, and counts (h, w), row 0 at the bottom."""

    title: str
    counts: Counts


def common_scale(maps: Sequence[Counts]) -> int:
    """The top of one scale for all maps: the largest of their 99.5th percentiles, rounded up to two digits."""
    top = max(1.0, *(float(np.percentile(counts, 99.5)) for counts in maps))
    step = 10 ** max(math.floor(math.log10(top)) - 1, 0)
    return math.ceil(top / step) * step


def draw(panels: Sequence[Panel], path: Path, title: str, label: str, top: int | None = None) -> int:
    """Write the panels, all of one shape, to a PNG; `label` says what the scale counts. Return the scale's top.

    The scale goes from 0 to `top`, by default `common_scale`; counts above it have a colour of their own.
    """
    chosen = common_scale([panel.counts for panel in panels]) if top is None else top
    sheet = _Sheet(len(panels), *panels[0].counts.shape)
    figure = Figure(figsize=(sheet.width, sheet.height), dpi=sheet.dpi, facecolor="white")
    colours = colormaps[COLOURS].with_extremes(over=ABOVE)
    norm = Normalize(0, chosen)
    _write(figure, sheet, 0, title, size=13, weight="bold")
    for i, panel in enumerate(panels):
        _draw_panel(figure, sheet, i, panel, colours, norm)
    _draw_scale(figure, sheet, panels, label, colours, norm)
    with warnings.catch_warnings():
        # A scene's name may have letters that the font lacks; they become boxes.
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        FigureCanvasAgg(figure).print_png(path)
    return chosen


class _Sheet:
    """Where things lie on the sheet, in inches from its top left."""

    def __init__(self, count: int, rows: int, columns: int) -> None:
        longer = max(rows, columns)
        self.dpi = longer * math.ceil(FEWEST_PIXELS / longer) / PANEL_INCHES
        self.across = count if count <= 3 else math.ceil(math.sqrt(count))
        self.panel_width = max(PANEL_INCHES * columns / longer, PANEL_INCHES * 0.8)
        self.panel_height = max(PANEL_INCHES * rows / longer, PANEL_INCHES * 0.2)
        down = math.ceil(count / self.across)
        self.width = 2 * MARGIN + self.across * self.panel_width + (self.across - 1) * GAP
        self.height = TITLE + down * (self.panel_height + CAPTION) + SCALE

    def panel(self, index: int) -> tuple[float, float]:
        """The left and top of a panel's map; its caption stands above it."""
        row, column = divmod(index, self.across)
        left = MARGIN + column * (self.panel_width + GAP)
        return left, TITLE + row * (self.panel_height + CAPTION) + CAPTION

    def box(self, left: float, top: float, width: float, height: float) -> tuple[float, float, float, float]:
        """A box as matplotlib takes it: fractions from the bottom left."""
        return left / self.width, 1 - (top + height) / self.height, width / self.width, height / self.height


def _draw_panel(figure: Figure, sheet: _Sheet, i: int, panel: Panel, colours: Colormap, norm: Normalize) -> None:
    left, top = sheet.panel(i)
    axes: Axes = figure.add_axes(sheet.box(left, top, sheet.panel_width, sheet.panel_height))
    axes.imshow(panel.counts, cmap=colours, norm=norm, origin="lower", interpolation="nearest", anchor="NW")
    axes.set_axis_off()
