"""The comparison's table as it is shown, in Markdown and LaTeX; every name stays text."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable
from typing import TYPE_CHECKING

from server.comparison.figures import NOT_MEASURED, write_figure, write_interval, write_ratio
from server.comparison.metrics import Metric
from server.comparison.pivot import Cell, Comparison, label

if TYPE_CHECKING:
    import pandas as pd

Escape = Callable[[str], str]

_MARKDOWN = re.compile(r"[\\`*_\[\]<>&|$~#!{}]|(?<=:)//")
_LATEX = {
    **{char: f"\\{char}" for char in "&%$#_{}"},
    **{char: f"{{{char}}}" for char in "[]*`"},
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r"{\char34}",
    "–": "--",
    "→": r"$\rightarrow$",
    "×": r"$\times$",
    "\N{NO-BREAK SPACE}": "~",
    "\N{SUPERSCRIPT MINUS}": "$^{-}$",
    "ß": r"\ss{}",
}
_ACCENTS = dict(zip("\u0300\u0301\u0302\u0303\u0308", "`'^~\"", strict=True))
_JOINED = "-',"
"""What TeX's fonts make one sign of where it comes twice."""
_RULES = r"\providecommand{\toprule}{\hline}\providecommand{\midrule}{\hline}\providecommand{\bottomrule}{\hline}"


def to_markdown(table: Comparison) -> str:
    """A pipe table (GitHub Flavored Markdown) under a line that says what it shows, with the notes below it."""
    frame, head = _frame(table, escape_markdown)
    text: str = frame.to_markdown(index=False, headers=head, tablefmt="pipe", disable_numparse=True) or ""
    notes = [f"{escape_markdown(note)}\n" for note in table.notes]
    return "\n".join([f"{escape_markdown(_caption(table))}\n", f"{text}\n", *notes])


def to_latex(table: Comparison) -> str:
    """A table environment that compiles with any LaTeX, with or without the package booktabs."""
    frame, head = _frame(table, escape_latex)
    caption = " ".join(escape_latex(text) for text in [_caption(table), *table.notes])
    names = [name.replace("{", "{{").replace("}", "}}") for name in head]  # pandas takes a head for a format.
    text: str = frame.to_latex(index=False, header=names, escape=False, caption=caption, column_format="l" * len(head))
    return f"{_RULES}\n{text}"


def escape_markdown(text: str) -> str:
    """A text on one line with a backslash before whatever Markdown or HTML would read."""
    return _MARKDOWN.sub(lambda found: f"\\{found[0]}", _one_line(text))


def escape_latex(text: str) -> str:
    """A text on one line as LaTeX prints it in any font encoding.

    Braces keep characters from joining and from being read as an argument after a line's end (`[`, `*`). A letter that
    plain TeX cannot make is named by its code point.
    """
    plain = unicodedata.normalize("NFC", _one_line(text))
    joined = [i > 0 and char == plain[i - 1] and char in _JOINED for i, char in enumerate(plain)]
    return "".join(("{}" if apart else "") + _latex_char(char) for char, apart in zip(plain, joined, strict=True))


def _latex_char(char: str) -> str:
    if char in _LATEX:
        return _LATEX[char]
    if char.isascii():
        return char
    plain = unicodedata.normalize("NFKD", char)
    if unicodedata.decomposition(char).startswith("<super>") and plain.isascii():
        return f"$^{{{plain}}}$"
    letter, accent = plain[:1], plain[1:]
    if letter.isascii() and letter.isalpha() and letter not in "ij" and accent in _ACCENTS:
        return f"\\{_ACCENTS[accent]}{{{letter}}}"
    return f"(U+{ord(char):04X})"


def _one_line(text: str) -> str:
    """Control and format characters, which could turn text round or break a line, become spaces."""
    return "".join(" " if unicodedata.category(char) in ("Cc", "Cf", "Cs", "Zl", "Zp") else char for char in text)


def _caption(table: Comparison) -> str:
    axes = f"by {', '.join(table.rows)} and {', '.join(table.columns)}"
    unit = f", {table.metric.unit}" if table.metric.unit else ""
    return f"{table.metric.label}{unit}, {axes}; {table.metric.better} is better."


def _frame(table: Comparison, escape: Escape) -> tuple[pd.DataFrame, list[str]]:
    """The table as texts, and its head; its columns are numbered, for two heads may be the same text."""
    import pandas as pd

    head = [*table.rows, *(label(key) for key in table.column_keys)]
    lines = [
        [*key, *(_cell(table.metric, cell) for cell in line)]
        for key, line in zip(table.row_keys, table.cells, strict=True)
    ]
    texts = [[escape(text) for text in line] for line in lines]
    return pd.DataFrame(texts, columns=range(len(head))), [escape(name) for name in head]


def _cell(metric: Metric, cell: Cell | None) -> str:
    """A figure with its unit and interval, its ratio to the baseline, and how many results stand behind it."""
    if cell is None:
        return NOT_MEASURED
    figure = cell.figures[metric.key]
    interval = write_interval(metric, figure)
    parts = [write_figure(metric, figure) + (f" ({interval})" if interval else "")]
    if cell.ratio is not None:
        parts.append(write_ratio(cell.ratio))
    if cell.count > 1:
        parts.append(f"latest of {cell.count}")
    return "; ".join(part for part in parts if part)
