"""Charts as SVG for a page: text stays text, and colours are the page's, so that they follow light and dark."""

from __future__ import annotations

import io
import re
import threading
from html import escape
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from server.paper.panels import Bar, Panel
from server.paper.words import figure_text

WIDTH = 5.0
"""Inches of 72 units; a page shows a unit as about a pixel."""
BAR, GROUP, EDGE = 0.22, 0.33, 0.10
"""Inches: one bar, a group's heading, the margin above and below."""
REACH = 0.60
"""The longest bar's share of the width; its figure stands to the right."""
TEXT = 10.5

INK, QUIET, LINE = "#010101", "#020202", "#030303"
_SERIES = tuple(f"#0{i}0{i}0{i}" for i in range(4, 10))
_VARIABLES = {INK: "--ink", QUIET: "--quiet", LINE: "--line"} | {c: f"--s{i}" for i, c in enumerate(_SERIES)}
"""Stand-ins that become the page's variables; matplotlib knows no variables."""

_SETTINGS: Any = {"svg.fonttype": "none", "svg.hashsalt": "rayfarm", "font.family": "DejaVu Sans", "font.size": TEXT}
_DRAWING = threading.Lock()
"""matplotlib's settings are the process's."""


def bars_svg(panel: Panel, name: str, series: list[str]) -> str:
    """A panel of horizontal bars as inline SVG; `name` makes its ids the page's only ones, `series` gives colours."""
    rows = [(group, bars) for group, bars in panel.groups if any(bar.value is not None for bar in bars)]
    single = len(panel.series) == 1
    height = 2 * EDGE + sum(len(bars) * BAR + GROUP for _, bars in rows)
    with _DRAWING, matplotlib.rc_context(_SETTINGS):
        figure = Figure((WIDTH, height))
        FigureCanvasSVG(figure)
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_axis_off()
        axes.set_xlim(0, 1)
        axes.set_ylim(height, 0)
        most = max((bar.high or bar.value or 0 for _, bars in rows for bar in bars), default=0) or 1.0
        top = EDGE
        for group, bars in rows:
            axes.text(0.002, top + GROUP * 0.66, group, color=INK, weight="bold", va="center", parse_math=False)
            top += GROUP
            for bar in bars:
                _draw(axes, bar, top, most, 0 if single else series.index(bar.series))
                top += BAR
        axes.plot([0.0015, 0.0015], [EDGE + GROUP * 0.9, height - EDGE / 2], color=LINE, lw=1)
        out = io.StringIO()
        figure.savefig(out, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    return _for_page(out.getvalue(), name, f"{panel.title}, {panel.unit}. {_spoken(panel)}")


def _draw(axes: Axes, bar: Bar, top: float, most: float, colour: int) -> None:
    middle = top + BAR / 2
    if bar.value is None:
        axes.text(0.01, middle, f"{bar.series}: not measured", color=QUIET, va="center", parse_math=False)
        return
    length = bar.value / most * REACH
    axes.barh(middle, length, height=BAR * 0.78, color=_SERIES[colour], edgecolor="none")
    end = length
    if bar.low is not None and bar.high is not None:
        low, end = bar.low / most * REACH, bar.high / most * REACH
        axes.plot([low, end], [middle, middle], color=INK, lw=1)
        for x in (low, end):
            axes.plot([x, x], [middle - BAR * 0.2, middle + BAR * 0.2], color=INK, lw=1)
    axes.text(max(end, length) + 0.012, middle, bar.text, color=INK, va="center", parse_math=False)


def _spoken(panel: Panel) -> str:
    groups = []
    for group, bars in panel.groups:
        said = [f"{bar.series} {figure_text(bar.value)}" for bar in bars]
        groups.append(f"{group}: {', '.join(said)}")
    return "; ".join(groups)


def _for_page(svg: str, name: str, spoken: str) -> str:
    """The SVG element alone, with ids of its own, the page's colours and font, and a text for those who hear it."""
    body = svg[svg.index("<svg") :]
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL)
    body = re.sub(r'\b(id="|href="#|url\(#)', rf"\g<1>{name}-", body)
    body = re.sub(r"font: (?:([a-z0-9]+) )?([\d.]+)px [^;\"]*", _font, body)
    for stand_in, variable in _VARIABLES.items():
        body = body.replace(stand_in, f"var({variable})")
    view = re.search(r'viewBox="[^"]*"', body)
    assert view is not None
    body = body[body.index(">", body.index("<svg")) + 1 :]
    return f'<svg class="chart" role="img" aria-label="{escape(spoken)}" {view[0]}>{body}'


def _font(match: re.Match[str]) -> str:
    weight = f"font-weight: {match[1]}; " if match[1] else ""
    return f"{weight}font-size: {match[2]}px"
