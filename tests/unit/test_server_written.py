"""Markdown and LaTeX tables, and Parquet: names stay text, values stay what they are."""

from __future__ import annotations

import io
import json
import random
import re
from typing import Any

import pyarrow.parquet as pq
import pytest
from markdown_it import MarkdownIt

from server.comparison.flat import COLUMNS, Stored, flatten
from server.comparison.metrics import METRICS
from server.comparison.parquet import parquet_pieces
from server.comparison.pivot import Comparison, compare
from server.comparison.written import escape_latex, escape_markdown, to_latex, to_markdown

HOSTILE = (
    "a|b",
    r"a\|b\\",
    r"\end{document}",
    "100 % of $x$ & #1_2 {3} ^~",
    "[x](http://h.example) ![i](//h.example)",
    "<script>alert(1)</script>",
    "**bold** _it_ `code` &amp; ~~x~~",
    "[*] --- '' ?`",
    "grün ß é 人 😀",
    "line\nbreak\ttab\u202eturned",
    "=1+1",
    "",
)
ALPHABET = "ab|\\$&%_{}[]*`~^<>#\"'!-,?é人 "


def names() -> list[str]:
    draw = random.Random(7)
    return [*HOSTILE, *("".join(draw.choices(ALPHABET, k=12)) for _ in range(200))]


def table_of(row: str, column: str) -> Comparison:
    document = {"scene": column, "traversal": row, "mrays_per_s": 2.0, "size": [8, 8]}
    frame = {"frame_ms": {"median": 20.0, "ci_low": 18.0, "ci_high": 22.0}}
    return compare([Stored(1, None, "", document | frame)], METRICS["mrays_per_s"])


def plain(text: str) -> str:
    """As a renderer shows it: what cannot be seen is a space, and spaces at the ends of a cell are nothing."""
    return re.sub(r"[\n\t\u202e]", " ", text).strip()


@pytest.mark.parametrize("seed", range(len(names())))
def test_markdown_cells_are_read_back_as_they_were(seed: int) -> None:
    row, column = names()[seed], names()[-seed]
    tokens = (
        MarkdownIt("commonmark", {"html": True})
        .enable(["table", "strikethrough"])
        .parse(to_markdown(table_of(row, column)))
    )
    found = [token for token in tokens if token.type == "inline"]
    kinds = {child.type for token in found for child in token.children or []}
    assert kinds <= {"text", "text_special"}
    texts = ["".join(child.content for child in token.children or []) for token in found]
    assert texts[1:] == ["traversal", plain(column), plain(row), "2.00 Mray/s (1.82–2.22)"]


def test_markdown_makes_no_link_of_an_address() -> None:
    assert escape_markdown("http://h.example") == r"http:\//h.example"


# The commands that an escaped text may hold: each is of LaTeX's kernel and takes what stands in the braces after it.
COMMANDS = r"textbackslash|textasciitilde|textasciicircum|textless|textgreater|textbar|char34|times|rightarrow|ss"
SAFE = re.compile(
    rf"(?:\\(?:{COMMANDS})(?![a-z])|\\[&%$#_{{}}]|\\[`'^~\"]\{{[A-Za-z]\}}|[A-Za-z0-9 .,;:/()<>=+!?'@~-]|\$[^$]*\$)"
)


@pytest.mark.parametrize("seed", range(len(names())))
def test_latex_holds_only_known_commands_and_braces_that_match(seed: int) -> None:
    text = escape_latex(names()[seed])
    assert text.isascii()
    depth = 0
    for part in re.findall(rf"{SAFE.pattern}|[{{}}]|\[|\]|\*|`|.", text):
        depth += {"{": 1, "}": -1}.get(part, 0)
        assert depth >= 0
        # Outside braces these are read as an argument after a line's end, or join with a neighbour.
        assert part not in "[]*`" or depth > 0
        assert SAFE.fullmatch(part) or part in ("{", "}", "[", "]", "*", "`"), (part, text)
    assert depth == 0
    assert not re.search(r"--|''|,,", text)


def test_latex_has_one_cell_a_column_and_ends_every_line() -> None:
    text = to_latex(table_of(r"a & b \\ c", "[5pt]"))
    body = re.findall(r"^(.*) \\\\$", text, re.MULTILINE)
    assert [len(re.split(r"(?<!\\)&", line)) for line in body] == [2, 2]
    assert text.count(r"\begin{tabular}{ll}") == text.count(r"\end{tabular}") == 1
    assert "2.00 Mray/s (1.82--2.22)" in text
    assert escape_latex("2.0×10⁻⁵") == r"2.0$\times$10$^{-}$$^{5}$"
    assert (escape_latex("grün"), escape_latex("人")) == (r"gr\"{u}n", "(U+4EBA)")


def test_two_columns_of_one_name_are_two_columns() -> None:
    documents = [
        {"scene": scene, "device": {"id": device}, "traversal": "bvh-stack", "mrays_per_s": speed}
        for scene, device, speed in (("a / b", "c", 1.0), ("a", "b / c", 2.0))
    ]
    stored = [Stored(i, None, "", document) for i, document in enumerate(documents)]
    table = compare(stored, METRICS["mrays_per_s"], columns=("scene", "device"))
    assert all(f"{speed}.00 Mray/s" in text for speed in (1, 2) for text in (to_latex(table), to_markdown(table)))


def documents(draw: random.Random) -> list[dict[str, Any]]:
    return [
        {
            "scene": draw.choice(HOSTILE),
            "traversal": "bvh-stack",
            "size": [8, 8],
            "triangles": 7,
            "mrays_per_s": draw.choice([None, 1, 2.5]),
            "frames_ms": [draw.random() for _ in range(3)],
            "frames_by_round": [2, 1],
            "specialised": draw.choice([None, [], ["x"]]),
            "error": {"counts": {"hits": draw.randrange(9)}, "false_hit": 0.0},
            "versions": {"plan": 1, "shader_sha": "ab"},
            **draw.choice([{}, {"more": 1}, {"more": "one"}, {"more": [1]}]),
        }
        for _ in range(2500)
    ]


@pytest.mark.parametrize("seed", [1, 2])
def test_parquet_has_every_value_in_groups_of_rows(seed: int) -> None:
    rows = [flatten(Stored(i, None, "t", one), lists=True) for i, one in enumerate(documents(random.Random(seed)))]
    taken = 0

    def counted() -> Any:
        nonlocal taken
        for row in rows:
            taken += 1
            yield row

    pieces = parquet_pieces(counted(), ["more", "frames_ms", "frames_by_round", "specialised", "error_counts_hits"])
    first = next(pieces)
    assert taken < len(rows)  # The rest is asked for when the first rows are written.
    file = pq.ParquetFile(io.BytesIO(first + b"".join(pieces)))
    assert file.metadata.num_row_groups == 3
    found = file.read().to_pylist()
    assert set(found[0]) == {*COLUMNS, "more", "frames_ms", "frames_by_round", "specialised", "error_counts_hits"}
    for line, row in zip(found, rows, strict=True):
        for name in ("job", "scene", "mrays_per_s", "triangles", "frames_ms", "frames_by_round", "error_counts_hits"):
            assert line[name] == row.get(name)
        more = row.get("more")
        assert line["more"] == (more if more is None or isinstance(more, str) else json.dumps(more))
