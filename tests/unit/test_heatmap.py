"""Heatmaps: the counts against what must come out and against a slice's, and the picture against the counts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from renderer.bench import run_slice
from renderer.child import ChildError
from renderer.pictures.counts import Counts, count_pixels
from renderer.pictures.heatmap import heatmap, summarise
from renderer.pictures.heatmap_picture import ABOVE, Panel, common_scale, draw
from renderer.records import Hits, Rays, Records
from renderer.request import Request, RequestError
from renderer.variant import Variant

BOX_TRIANGLES = 36

UPPER_LEFT = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
-2 0 0
0 2 0
-2 2 0
3 0 1 2
"""


def make_records() -> Records:
    """2x2 pixels and two lights; pixel 1 cast two shadow rays, pixel 2 one. Columns: nodes ... words."""
    rays = Rays(np.zeros((4, 3), np.float32), np.ones((4, 3), np.float32), np.ones(4, np.float32))
    return Records(
        size=(2, 2),
        primary=rays,
        hits=Hits(np.ones(4, np.float32), np.zeros(4, np.int32)),
        shadow=rays[:3],
        shadow_pixel=np.array([1, 1, 2], np.int32),
        shadow_light=np.array([0, 1, 0], np.int32),
        occluded=np.zeros(3, bool),
        primary_counts=np.array([[1, 0, 0, 5, 9], [2, 0, 0, 6, 9], [3, 0, 0, 7, 9], [4, 0, 0, 8, 9]], np.uint32),
        shadow_counts=np.array([[10, 0, 0, 1, 2], [20, 0, 0, 1, 2], [30, 0, 0, 1, 2]], np.uint32),
        cut=np.zeros(4, bool),
        rasterised=False,
    )


@pytest.mark.parametrize(
    ("rays", "metric", "expected"),
    [
        ("primary", "nodes", [[1, 2], [3, 4]]),
        ("shadow", "nodes", [[0, 30], [30, 0]]),
        ("both", "nodes", [[1, 32], [33, 4]]),
        ("both", "triangles", [[5, 8], [8, 8]]),
        ("both", "bytes", [[36, 52], [44, 36]]),
    ],
)
def test_a_pixel_sums_its_rays(rays: str, metric: str, expected: list[list[int]]) -> None:
    assert count_pixels(make_records(), rays, metric).tolist() == expected


def test_brute_force_tests_every_triangle_and_no_node() -> None:
    request = Request("cornell-box", Variant("brute-force"), size=(8, 6), rays="primary")
    assert heatmap(request, "triangles").tolist() == [[BOX_TRIANGLES] * 8] * 6
    assert not heatmap(request, "nodes").any()


@pytest.mark.parametrize("variant", [Variant("kd-push-down", "compute"), Variant("bvh-stack", "hybrid")], ids=str)
def test_the_sum_is_the_figure_of_a_slice(variant: Variant) -> None:
    request = Request("cornell-box", variant, size=(24, 16), frames=1, rounds=1, check="none")
    measured = run_slice(request, 0)
    cast = measured["rays"]["shadow"] + (0 if variant.method == "hybrid" else 24 * 16)
    for metric in ("nodes", "triangles", "bytes"):
        assert heatmap(request, metric).sum() == pytest.approx(measured["per_ray"][metric] * cast, rel=1e-9)


def test_row_0_is_at_the_bottom(tmp_path: Path) -> None:
    scene = tmp_path / "upper_left.ply"
    scene.write_text(UPPER_LEFT)
    counts = heatmap(Request(str(scene), Variant("brute-force"), size=(16, 16), rays="shadow"), "triangles")
    rows, columns = np.nonzero(counts)
    assert columns.mean() < 7.5 < rows.mean()


def test_a_failure_is_one_sentence() -> None:
    with pytest.raises(RequestError, match=r"Unknown metric 'heat': choose one of nodes, triangles, bytes\."):
        heatmap(Request("cornell-box"), "heat")
    with pytest.raises(ChildError, match=r"^There is no scene 'nowhere'.*\.$"):
        heatmap(Request("nowhere"))
    with pytest.raises(ChildError, match="its time limit"):
        heatmap(Request("cornell-box"), timeout_s=0.01)


def test_brute_force_in_passes_is_not_counted() -> None:
    request = Request("forest:40000", Variant("brute-force"), size=(4, 4))
    with pytest.raises(ChildError, match="passes, which carry no counters"):
        heatmap(request)


def test_the_scale_is_common_and_round() -> None:
    quiet, loud = np.full((10, 10), 7), np.full((10, 10), 1234)
    assert common_scale([quiet]) == 7
    assert common_scale([quiet, loud]) == 1300
    assert common_scale([np.zeros((3, 3), np.int64)]) == 1
    loud[0, 0] = 10**9
    assert common_scale([np.tile(loud, (5, 5))]) > 1300
    spread = np.full((100, 100), 50)
    spread[0, :10] = 9999
    assert common_scale([spread]) == 50


def test_figures() -> None:
    figures = summarise(np.arange(101).reshape(1, 101))
    assert (figures.mean, figures.p50, figures.p99, figures.max) == (50.0, 50.0, 99.0, 100)


@pytest.mark.parametrize("shape", [(4, 4), (1, 7), (9, 2)], ids=str)
def test_the_picture_shows_each_pixel_in_its_place(tmp_path: Path, shape: tuple[int, int]) -> None:
    rows, columns = shape
    counts = np.zeros(shape, np.int64)
    counts[-1, -1] = 99
    image = read_picture(tmp_path, [Panel("one", counts)], top=10)
    above = np.array([int(ABOVE[i : i + 2], 16) for i in (1, 3, 5)])
    black = black_box(image)
    height, width = (black[1] - black[0] + 1), (black[3] - black[2] + 1)
    cell = (height // rows // 2, width // columns // 2)
    upper_right = image[black[0] + cell[0], black[3] - cell[1]]
    assert (upper_right == above).all()
    assert width / height == pytest.approx(columns / rows, rel=0.05)


def test_the_scale_tops_where_told_and_says_so(tmp_path: Path) -> None:
    counts = np.full((5, 5), 3)
    assert draw([Panel("one", counts)], tmp_path / "a.png", ["a"], "nodes", 8) == 8
    assert draw([Panel("one", counts)], tmp_path / "b.png", ["a"], "nodes") == 3


def test_hostile_names_are_drawn_as_they_are(tmp_path: Path) -> None:
    title = ["$\\frac{$ _^ 森林 <b>" + "long " * 80, "two"]
    image = read_picture(tmp_path, [Panel("$x_{", np.ones((6, 6), np.int64))] * 7, title=title)
    assert image.shape[1] > 3 * 400


def read_picture(folder: Path, panels: list[Panel], top: int | None = None, title: list[str] | None = None) -> Counts:
    path = folder / "map.png"
    draw(panels, path, title or ["a title"], "nodes fetched per pixel", top)
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB")).astype(np.int64)


def black_box(image: Counts) -> tuple[int, int, int, int]:
    """First and last row and column of the map: neither white nor text, found as the rows that are mostly coloured."""
    coloured = (image != 255).any(axis=2)
    map_rows = np.nonzero(coloured.mean(axis=1) > 0.05)[0]
    first = longest_run(map_rows)
    columns = np.nonzero(coloured[first[0] : first[1] + 1].mean(axis=0) > 0.9)[0]
    return first[0], first[1], int(columns.min()), int(columns.max())


def longest_run(values: Counts) -> tuple[int, int]:
    runs = np.split(values, np.nonzero(np.diff(values) != 1)[0] + 1)
    longest = max(runs, key=len)
    return int(longest[0]), int(longest[-1])
