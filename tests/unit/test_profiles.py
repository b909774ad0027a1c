"""Profilers' files: every format's columns, names and units; exact figures; one sentence for each that is broken."""

from __future__ import annotations

import io
import random
import statistics
from pathlib import Path

import numpy as np
import pytest

from server.profiles import blocks, spool
from server.profiles.errors import ProfileError
from server.profiles.formats import read_map
from server.profiles.names import Series, read_series
from server.profiles.reader import Imported, read_profile
from server.profiles.spool import Spool
from server.profiles.store import clean_name
from server.profiles.units import read_unit

FIXTURES = Path(__file__).parents[1] / "fixtures" / "profiles"
LONG = "Process,Category,Metric,Timestamp,TimestampRaw,Value\n"


def read(folder: Path, content: str | bytes, form: str = "auto", *pairs: str) -> Imported:
    path = folder / "profile.csv"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_profile(path, form, read_map(pairs))


def figures(imported: Imported) -> dict[Series, tuple[int, float, float, float, float, str | None, str | None]]:
    return {
        one.series: (one.count, one.mean, one.median, one.min, one.max, one.first_time, one.last_time)
        for one in imported.summaries
    }


def test_snapdragon_realtime() -> None:
    found = read_profile(FIXTURES / "snapdragon_realtime.csv")
    assert (found.format, found.rows) == ("snapdragon-realtime", 18)
    assert figures(found) == {
        Series("SP Memory Read", None, None, "B/s"): (3, 170e6, 110e6, 100e6, 300e6, "1000", "1100"),
        Series("% Shader ALU Capacity Utilized", None, None, "%"): (3, 90.5 / 3, 30.5, 20, 40, "1000", "1100"),
        Series("% Time ALUs Working", None, None, "%"): (3, 60, 60, 50, 70, "1000", "1100"),
        Series("ALU / Fragment", None, None, None): (3, 1000, 1000, 900, 1100, "1000", "1100"),
        Series("% Linear Filtered", "123", None, "%"): (3, 2, 2, 1, 3, "1000", "1100"),
        Series("FPS", "1", "com.example.app", None): (3, 60, 60, 59, 61, "1000", "1100"),
    }


def test_snapdragon_draws() -> None:
    found = read_profile(FIXTURES / "snapdragon_draws.csv")
    assert (found.format, found.rows) == ("snapdragon-draws", 6)
    assert figures(found) == {
        Series("SP Memory Read", None, "7", "B"): (3, 13312 / 3, 4096, 1024, 8192, "1", "3"),
        Series("ALU / Fragment", None, "7", None): (3, 15.5, 13.5, 12.5, 20.5, "1", "3"),
    }


def test_perfetto() -> None:
    found = read_profile(FIXTURES / "perfetto.csv")
    assert (found.format, found.rows) == ("perfetto", 7)
    assert figures(found) == {
        Series("Vertex / Second", None, "0", "vertex/s"): (2, 10, 10, 5, 15, "11", "21"),
        Series("Bytes read", None, "0", "B"): (2, 8, 8, 7, 9, "12", "22"),
        Series("% Time ALUs Working", None, "0", "%"): (2, 61, 61, 60, 62, "14", "24"),
        Series("Vertex / Second", None, "1", "vertex/s"): (1, 99, 99, 99, 99, "24", "24"),
    }


def test_agi_gapit() -> None:
    found = read_profile(FIXTURES / "agi_gapit.csv")
    assert found.format == "agi-gapit"
    assert figures(found) == {
        Series("Time", None, None, "ns"): (3, 18500 / 3, 6500, 5000, 7000, "120", "151"),
    }


def test_any_wide_file_by_a_map() -> None:
    pairs = read_map(["@time=Time", "SP Memory Read (Bytes)=Ext. read bytes", "% Time ALUs Working = GPU active"])
    found = read_profile(FIXTURES / "streamline.csv", column_map=pairs)
    assert (found.format, found.rows) == ("mapped", 3)
    assert figures(found) == {
        Series("SP Memory Read", None, None, "B"): (2, 650000, 650000, 640000, 660000, "0.00", "0.02"),
        Series("% Time ALUs Working", None, None, "%"): (3, 1050, 1050, 1000, 1100, "0.00", "0.02"),
    }


def test_any_long_file_by_a_map(tmp_path: Path) -> None:
    found = read(tmp_path, "what\tx\tu\na\t1\tMB / second\na\t2\tMB/s\n", "auto", "@metric=what", "@value=x", "@unit=u")
    assert figures(found) == {Series("a", None, None, "MB/s"): (2, 1.5, 1.5, 1, 2, None, None)}


@pytest.mark.parametrize(
    ("written", "unit", "series"),
    [
        ("FPS[1]", "", ("FPS", "1", None)),
        ("% Linear Filtered[123]", "", ("% Linear Filtered", "123", "%")),
        ("SP Memory Read (Bytes / Second)[2]", "", ("SP Memory Read", "2", "B/s")),
        ("SP Memory Read[2] (Bytes/Second)", "", ("SP Memory Read", "2", "B/s")),
        ("Clocks (GPU)", "", ("Clocks (GPU)", None, None)),
        ("[1]", "", ("[1]", None, None)),
        ("Time(ns)", "", ("Time", None, "ns")),
        ("GPU % Utilization", "", ("GPU % Utilization", None, None)),
        ("x (Bytes)", "KB", ("x", None, "KB")),
        ("=HYPERLINK(1)", "", ("=HYPERLINK(1)", None, None)),
    ],
)
def test_names(written: str, unit: str, series: tuple[str, str | None, str | None]) -> None:
    name, instance, expected = series
    assert read_series(written, "", unit) == Series(name, instance, None, expected)


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("Bytes / Second", "B/s"),
        ("bytes/sec", "B/s"),
        ("25/22", "vertex/s"),
        ("27/21:21", "triangle/ms:ms"),
        ("Triangle/ms:ms", "triangle/ms:ms"),
        ("7/0", "B"),
        ("0", None),
        ("99", "99"),
        ("", None),
        ("beats", "beats"),
        ("a/b/c", "a/b/c"),
    ],
)
def test_units(text: str, unit: str | None) -> None:
    assert read_unit(text) == unit


@pytest.mark.parametrize("ending", ["\n", "\r\n", ",\n"], ids=["LF", "CRLF", "a delimiter at each end"])
@pytest.mark.parametrize("bom", ["", "\ufeff"], ids=["plain", "BOM"])
def test_byte_order_mark_and_line_ends(tmp_path: Path, bom: str, ending: str) -> None:
    text = bom + LONG.strip() + "\n" + f"p,c,FPS,1,1000,60{ending}p,c,FPS,2,2000,61{ending}\n"
    assert figures(read(tmp_path, text)) == {Series("FPS", None, "p", None): (2, 60.5, 60.5, 60, 61, "1", "2")}


BROKEN: dict[str, tuple[str | bytes, str]] = {
    "empty": (b"", "The file is empty"),
    "only a header": (LONG, "holds no value"),
    "binary": (b"\x7fELF\x02\x01\x00\x00" * 50, "no CSV but binary"),
    "binary later": (LONG.encode() + b"p,c,FPS,1,1,60\n\0\0\n", "no CSV but binary"),
    "UTF-16": (LONG.encode("utf-16"), "UTF-16"),
    "Latin-1": (LONG.encode() + "p,c,Température,1,1,60\n".encode("latin-1"), "not UTF-8"),
    "JSON": ('{"traceEvents": [\n', "No known format begins with"),
    "HTML": ("<!DOCTYPE html>\n<html>\n", "No known format begins with"),
    "prose": ("It was a dark night.\n", "No known format begins with"),
    "one line without end": ("x" * 600_000, "first line does not end"),
    "cut in a figure": (LONG + "p,c,FPS,1,1000,60\np,c,FPS,2,2000,6", "ends within a line"),
    "cut in a row": (LONG + "p,c,FPS,1,1000,60\np,c,FPS,2\n", "Row 2 has no value"),
    "cut in quotes": (LONG + 'p,c,FPS,1,1000,60\np,c,"FP', "ends within quotes"),
    "no metric": (LONG + "p,c,,1,1000,60\n", "Row 1 has no metric"),
    "a word for a figure": (LONG + "p,c,FPS,1,1,60\np,c,FPS,2,2,fast\n", "Row 2 has the value 'fast'"),
    "no number": (LONG + "p,c,FPS,1,1,nan\n", "Row 1 has the value 'nan'"),
    "infinite": (LONG + "p,c,FPS,1,1,inf\n", "Row 1 has the value 'inf'"),
    "decimal comma": (LONG + "p,c,FPS,1,1,60,5\n", "row 1 has more fields"),
    "far too long a row": (LONG + "p,c,FPS,1,1,60\np,c,FPS,2,2,1,2,3\n", "more fields than the first line"),
    "mixed units": (LONG + "p,c,SP (Bytes),1,1,1\np,c,SP (Bytes / Second),1,1,1\n", "'SP' has values in B and B/s"),
    "a unit and none": (LONG + "p,c,SP (Bytes),1,1,1\np,c,SP,1,1,1\n", "B and no unit"),
    "column twice": ("DrawID,CaptureID,MetricName,Value,Value\n1,2,FPS,1,1\n", "'Value' appears twice"),
    "endless name": (LONG + f"p,c,{'x' * 400},1,1,1\n", "more than 300 characters"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_is_told_in_one_sentence(tmp_path: Path, name: str) -> None:
    content, said = BROKEN[name]
    with pytest.raises(ProfileError, match=said) as caught:
        read(tmp_path, content)
    sentence = str(caught.value)
    assert sentence.endswith(".")
    assert "\n" not in sentence
    assert len(sentence) < 300


def test_more_series_than_make_sense(tmp_path: Path) -> None:
    rows = "".join(f"p,c,m{number},1,1,1\n" for number in range(10_001))
    with pytest.raises(ProfileError, match="more than 10000 metrics"):
        read(tmp_path, LONG + rows)


@pytest.mark.parametrize(
    ("form", "pairs", "said"),
    [
        ("perfetto", (), "no Perfetto GPU counters file: there is no column 'ts'"),
        ("excel", (), "Unknown format 'excel'"),
        ("mapped", (), "needs a column map"),
        ("perfetto", ("FPS=Value",), "needs no column map"),
        ("auto", ("FPS",), "write METRIC=COLUMN"),
        ("auto", ("FPS=",), "write METRIC=COLUMN"),
        ("auto", ("@when=x",), "Unknown role '@when'"),
        ("auto", ("a=Value", "a=Metric"), "mapped twice"),
        ("auto", ("a=Value", "b=Value"), "to one column"),
        ("auto", ("a=Nothing",), "no column 'Nothing'"),
        ("auto", ("@metric=Metric",), "both @metric and @value"),
        ("auto", ("@time=Timestamp",), "both @metric and @value"),
        ("auto", ("a=Value", "@unit=Metric"), "both @metric and @value"),
        ("auto", ("a=Value", "@metric=Metric", "@value=Value"), "both @metric and @value"),
    ],
)
def test_a_wrong_format_or_map_is_told(tmp_path: Path, form: str, pairs: tuple[str, ...], said: str) -> None:
    with pytest.raises(ProfileError, match=said):
        read(tmp_path, LONG + "p,c,FPS,1,1,60\n", form, *pairs)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("block", [64, 1000, 1 << 21])
def test_blocks_do_not_matter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block: int, seed: int) -> None:
    """Against the statistics module, with names that hold quotes, line ends and delimiters."""
    chosen = random.Random(seed)
    monkeypatch.setattr(blocks, "BLOCK", block)
    monkeypatch.setattr(spool, "BATCH", 64)
    names = ["plain", 'a "quoted" one', "two\nlines", "with, comma", "ends\r\n"]
    values: dict[str, list[float]] = {}
    rows = []
    for _ in range(chosen.randint(1, 400)):
        name, value = chosen.choice(names), chosen.choice([chosen.uniform(-1e9, 1e9), float(chosen.randint(-3, 3))])
        values.setdefault(name.strip(), []).append(value)
        quoted = name.replace('"', '""')
        rows.append(f'1,{value!r},"{quoted}",0,"d",""\n')
    found = read(tmp_path, '"ts","value","name","gpu_id","description","unit"\n' + "".join(rows))
    assert found.rows == len(rows)
    assert {one.series.name: one.count for one in found.summaries} == {key: len(all_) for key, all_ in values.items()}
    for one in found.summaries:
        expected = values[one.series.name]
        assert (one.median, one.min, one.max) == (statistics.median(expected), min(expected), max(expected))
        assert one.mean == pytest.approx(statistics.fmean(expected), rel=1e-9, abs=1e-3)


@pytest.mark.parametrize("seed", range(6))
def test_medians_are_exact_however_little_is_held(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    chosen = np.random.default_rng(seed)
    monkeypatch.setattr(spool, "BATCH", 100)
    series = chosen.choice(7, 2000, p=[0.6, 0.1, 0.1, 0.1, 0.05, 0.03, 0.02]).astype(np.int32)
    values = np.where(chosen.random(2000) < 0.3, chosen.integers(-2, 3, 2000), chosen.normal(0, 1e6, 2000) ** 3)
    values[::97] = -0.0
    kept = Spool(io.BytesIO())
    kept.add(series, values.astype(np.float64))
    counts = np.bincount(series, minlength=7)
    expected = [float(np.median(values[series == number])) for number in range(7)]
    assert kept.medians(counts).tolist() == expected


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ("../../etc/x.csv", "x.csv"),
        ("C:\\x.csv", "x.csv"),
        ('"; \r\nX: y.csv', '"; X: y.csv'),
        ("ü" * 300, "ü" * 200),
        ("a\0b\u202e.csv", "ab.csv"),
        ("..", "profile.csv"),
        ("", "profile.csv"),
    ],
)
def test_file_names_are_plain(given: str, kept: str) -> None:
    assert clean_name(given) == kept
