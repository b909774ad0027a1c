"""`rayfarm bench` and `rayfarm heatmap`, run as users run them, on the Cornell box."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from renderer.variant import AXES, matrix
from server.cli import app as cli
from server.cli.plan import plan_here, slow_warning
from server.studies import Study

Json = dict[str, Any]

RESULT = {
    *("scene", "family", "triangles", "device", "traversal", "method", "layout", "intersector", "box", "nodes"),
    *("precision", "offset", "builder", "sah", "size", "frames", "frame_ms", "fps", "mrays_per_s", "mrays_per_cpu_s"),
    *("rays_timed", "rays", "structure_bytes", "primitive_bytes", "build_ms", "per_ray", "overflows", "error"),
    *("vs_embree", "specialised", "versions", "started_at"),
}
"""One result's names."""

PARTS = {
    "device": {"id", "kind", "name", "driver"},
    "sah": {"traversal", "intersection", "cost", "epo"},
    "frame_ms": {"median", "ci_low", "ci_high"},
    "rays": {"primary", "shadow"},
    "per_ray": {"nodes", "inner", "leaves", "triangles", "bytes", "lines"},
    "error": {
        *("false_hit", "false_miss", "edge", "wrong_primitive", "t_rel_p99", "t_rel_max", "t_ulp_max"),
        *("shadow_mismatch", "flip"),
    },
    "vs_embree": {"mrays_per_cpu_s", "ratio"},
    "versions": {"rayfarm", "shader_sha", "plan"},
}

PAPER = ["bvh-parent-link", "bvh-restart-trail", "kd-push-down", "kd-backtrack"]

NO_GL = {"__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent/vendor.json"}

PLY = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face {faces}
property list uchar int vertex_indices
end_header
0 0 0
{x} 0 0
0 1 0
"""


@dataclass(frozen=True)
class Ran:
    """How a command ended."""

    code: int
    out: str
    err: str

    @property
    def results(self) -> list[Json]:
        return [json.loads(line) for line in self.out.splitlines()]

    @property
    def told(self) -> list[Json]:
        return [json.loads(line) for line in self.err.splitlines()]


def rayfarm(*words: str, folder: Path | None = None, environment: Mapping[str, str] | None = None) -> Ran:
    """Run the command in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-m", "server.cli.app", *words],
        capture_output=True,
        text=True,
        timeout=300,
        env={**os.environ, **(environment or {})},
        cwd=folder,
        check=False,
    )
    return Ran(done.returncode, done.stdout, done.stderr)


def test_a_result_has_the_names_of_the_design() -> None:
    ran = rayfarm("bench", "cornell-box", "--size", "32x24", "--frames", "6", "--rounds", "2", "--vs-embree", "--json")
    assert (ran.code, ran.err) == (0, "")
    (result,) = ran.results
    assert set(result) >= RESULT
    for name, parts in PARTS.items():
        assert parts <= set(result[name]), name
    assert result["size"] == [32, 24]
    assert result["frames"] == len(result["frames_ms"]) == 6
    assert result["rays"]["primary"] == 32 * 24
    assert result["rays_timed"] == sum(result["rays"].values())
    assert min(result["frames_ms"]) <= result["frame_ms"]["ci_low"] <= result["frame_ms"]["median"]
    assert result["vs_embree"]["ratio"] > 0
    assert result["vs_embree"]["mrays_per_cpu_s"] > 0
    assert result["error"]["false_hit"] == result["error"]["false_miss"] == 0


def test_what_was_not_measured_is_null() -> None:
    ran = rayfarm("bench", "cornell-box", "--size", "16", "--frames", "1", "--check", "none", "--json")
    (result,) = ran.results
    assert result["vs_embree"] == {"mrays_per_cpu_s": None, "ratio": None}
    assert {result["error"][name] for name in PARTS["error"]} == {None}
    assert result["frame_ms"]["ci_low"] is None
    assert result["per_ray"]["lines"] is None


def test_every_option_reaches_the_result() -> None:
    words = {
        "--traversal": "kd-backtrack", "--method": "compute", "--layout": "split", "--box": "williams",
        "--rays": "shadow", "--size": "24x16", "--frames": "4", "--rounds": "2", "--sah": "1,2", "--threads": "2",
        "--check": "oracle", "--specialise": "off",
    }  # fmt: skip
    flat = [part for pair in words.items() for part in pair]
    ran = rayfarm("bench", "cornell-box", *flat, "--camera", "0,1,-3", "0,1,0", "20", "--json")
    assert ran.code == 0, ran.err
    (result,) = ran.results
    assert [result[name] for name in ("traversal", "method", "layout", "box")] == list(words.values())[:4]
    assert (result["size"], result["frames"], result["rays_kind"]) == ([24, 16], 4, "shadow")
    assert (result["sah"]["traversal"], result["sah"]["intersection"]) == (1, 2)
    assert result["device"]["threads"] == 2
    assert result["specialised"] is None
    assert result["error"]["edge"] is None
    # The Cornell box shows its back to that camera and fills the whole image.
    assert result["rays_timed"] == result["rays"]["shadow"] == 24 * 16


def test_the_matrix_runs_and_lists_what_is_refused() -> None:
    ran = rayfarm(
        *("bench", "cornell-box", "--traversal", "paper,brute-force", "--box", "widened,williams"),
        *("--size", "16", "--frames", "1", "--check", "none", "--json"),
    )
    assert ran.code == 0, ran.err
    expected = {(name, box) for name in PAPER for box in ("widened", "williams")} | {("brute-force", "widened")}
    assert {(result["traversal"], result["box"]) for result in ran.results} == expected
    (told,) = ran.told
    assert (told["refused"]["traversal"], told["refused"]["box"]) == ("brute-force", "williams")
    assert told["reason"] == "brute-force tests no boxes: leave the box test at widened."


def test_all_leaves_out_a_long_brute_force_and_says_so() -> None:
    words = ("bench", "forest:40000", "--size", "160", "--frames", "1", "--check", "none", "--rays", "primary")
    ran = rayfarm(*words, "--traversal", "all", "--method", "compute", "--json")
    assert ran.code == 0, ran.err
    assert {result["traversal"] for result in ran.results} == {*AXES["traversal"]} - {"brute-force"}
    (told,) = ran.told
    assert told["refused"]["traversal"] == "brute-force"
    assert "10^9" in told["reason"]


def test_a_long_brute_force_asked_for_by_name_is_warned_of() -> None:
    axes = {"traversal": "bvh-stack,brute-force"}
    # 1024 x 1024 pixels, a primary and a shadow ray each, 40,000 triangles, 25 ns a test.
    warning = slow_warning(plan_here(Study(("forest:40000",), axes)), 3)
    assert warning is not None
    assert "8.4e+10 ray-triangle tests" in warning
    assert "about 2,097 s a frame, 6,291 s in all" in warning
    assert slow_warning(plan_here(Study(("cornell-box",), axes)), 3) is None
    assert slow_warning(plan_here(Study(("forest:40000",), {"traversal": "bvh-stack"})), 3) is None


def test_the_table_writes_what_was_not_measured_as_a_dash() -> None:
    ran = rayfarm(
        *("bench", "cornell-box", "--method", "fragment,hybrid", "--size", "32", "--frames", "6"),
        *("--builder", "median,sah", "--traversal", "bvh-stack,kd-push-down"),
    )
    assert ran.code == 0, ran.err
    assert "Left out kd-push-down fragment normal median, kd-push-down hybrid normal median:" in ran.err
    assert "cornell-box: 36 triangles" in ran.out
    table = [line.split() for line in ran.out.splitlines() if line.startswith(("bvh-stack", "kd-push-down"))]
    assert len(table) == 6
    for traversal, method, builder, *figures in table:
        assert builder == "sah" or traversal == "bvh-stack"
        embree, error, edge, shadow, raster = figures[4], *figures[-4:]
        assert embree == "–"
        assert (error, edge) == (("–", "–") if method == "hybrid" else ("0", "0"))
        assert (shadow, raster) == ("0", "0" if method == "hybrid" else "–")


def test_a_failure_ends_with_1_and_a_sentence() -> None:
    words = ("bench", "cornell-box", "--size", "16", "--frames", "1")
    ran = rayfarm(*words, "--json", environment=NO_GL)
    assert (ran.code, ran.out) == (1, "")
    (told,) = ran.told
    assert told["failed"]["traversal"] == "bvh-stack"
    assert told["reason"].startswith("No OpenGL 4.3 context could be made through EGL")
    ran = rayfarm(*words, environment=NO_GL)
    assert ran.code == 1
    assert ran.err.splitlines()[-1].startswith("bvh-stack fragment normal failed: No OpenGL 4.3 context")


BAD = {
    ("nowhere",): "There is no scene 'nowhere'",
    ("fairy-forest",): "fairy-forest is not here",
    ("none.ply",): "There is no file 'none.ply' here",
    ("cornell-box", "--traversal", "bvh"): "Unknown traversal 'bvh': choose one of brute-force, ",
    ("cornell-box", "--traversal", ""): "Unknown traversal ''",
    ("cornell-box", "--method", "vertex"): "Unknown method 'vertex': choose one of fragment, compute, hybrid.",
    ("cornell-box", "--layout", "normal,soa"): "Unknown layout 'soa'",
    ("cornell-box", "--rays", "all"): "Unknown rays 'all': choose one of primary, shadow, both.",
    ("cornell-box", "--method", "hybrid", "--rays", "primary"): "hybrid rasterises what the eye sees",
    ("cornell-box", "--size", "0"): "The width is 0: give a whole number from 1 to 4096.",
    ("cornell-box", "--size", "100000"): "The width is 100000: give",
    ("cornell-box", "--size", "16x"): "The size '16x' is not understood: write it as 512 or 640x480.",
    ("cornell-box", "--sah", "3"): "The SAH costs '3' are not understood: write them as 3.0,1.5.",
    ("cornell-box", "--sah", "nan,1"): "The SAH traversal cost is nan",
    ("cornell-box", "--frames", "0"): "The frames is 0",
    ("cornell-box", "--frames", "many"): "Invalid value for '--frames'",
    ("cornell-box", "--frames", "2", "--rounds", "3"): "The rounds are 3: give a whole number from 1 to the frames, 2.",
    ("cornell-box", "--threads", "0"): "The threads is 0",
    ("cornell-box", "--check", "twice"): "Unknown check 'twice': choose one of none, oracle, referee, image.",
    ("cornell-box", "--specialise", "maybe"): "Unknown specialise 'maybe': choose one of on, off.",
    ("cornell-box", "--camera", "0,0", "0,0,0", "60"): "The camera's eye '0,0' is not understood",
    ("cornell-box", "--camera", "0,0,0", "0,inf,0", "60"): "The camera's target '0,inf,0' is not understood",
    ("cornell-box", "--camera", "0,0,1", "0,0,0", "wide"): "The field of view 'wide' is not understood",
    ("cornell-box", "--camera", "0,0,1", "0,0,1", "60"): "The camera looks nowhere",
    ("cornell-box", "--camera", "0,0,1", "0,0,0", "180"): "The camera looks nowhere",
    ("cornell-box", "--camera", "0,0,1"): "Option '--camera' requires 3 arguments.",
}


@pytest.mark.parametrize(("words", "sentence"), BAD.items(), ids=[" ".join(words) for words in BAD])
def test_bad_input_is_one_sentence(words: tuple[str, ...], sentence: str, capsys: pytest.CaptureFixture[str]) -> None:
    check_refused("bench", words, sentence, capsys)


MESHES = {
    "empty.ply": PLY.format(faces=0, x=1),
    "nan.ply": PLY.format(faces=1, x="nan") + "3 0 1 2\n",
    "range.ply": PLY.format(faces=1, x=1) + "3 0 1 7\n",
    "torn.ply": PLY.format(faces=9, x=1) + "3 0 1 2\n",
    "noise.obj": "\0\1\2",
}


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("verb", ["bench", "heatmap"])
def test_a_bad_mesh_is_found_before_anything_runs(
    verb: str, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    path.write_text(MESHES[name])
    check_refused(verb, (str(path),), name, capsys)


def check_refused(verb: str, words: tuple[str, ...], sentence: str, capsys: pytest.CaptureFixture[str]) -> None:
    code = cli.run([verb, *words])
    out, err = capsys.readouterr()
    assert (code, out) == (2, "")
    assert err.startswith("rayfarm: ")
    assert sentence in err
    assert err.count("\n") == 1


def test_a_good_mesh_file_is_a_scene(tmp_path: Path) -> None:
    (tmp_path / "one.ply").write_text(PLY.format(faces=1, x=1) + "3 0 1 2\n")
    ran = rayfarm("bench", "one.ply", "--size", "16", "--frames", "1", "--json", folder=tmp_path)
    assert ran.code == 0, ran.err
    (result,) = ran.results
    assert (result["scene"], result["triangles"]) == ("one.ply", 1)
    assert 0 < result["rays"]["shadow"] < 16 * 16


def test_heatmaps_stand_side_by_side_on_one_scale(tmp_path: Path) -> None:
    ran = rayfarm("heatmap", "cornell-box", "--traversal", "paper", "--size", "32", "--json", folder=tmp_path)
    assert ran.code == 0, ran.err
    drawn = json.loads(ran.out)
    assert [entry["traversal"] for entry in drawn["maps"]] == PAPER
    assert drawn["file"] == "heatmap-cornell-box.png"
    for entry in drawn["maps"]:
        figures = entry["per_pixel"]
        assert 0 < figures["p50"] <= figures["p99"] <= figures["max"]
    assert drawn["scale_max"] >= max(entry["per_pixel"]["p99"] for entry in drawn["maps"])
    with Image.open(tmp_path / drawn["file"]) as image:
        assert image.width > 2 * 420
        assert image.height > 2 * 420


def test_a_heatmap_takes_a_scale_and_a_name(tmp_path: Path) -> None:
    words = ("--metric", "bytes", "--rays", "primary", "--max", "123", "--size", "16x8", "--output", "x.png")
    ran = rayfarm("heatmap", "cornell-box", *words, folder=tmp_path)
    assert ran.code == 0, ran.err
    assert ran.out.splitlines()[-1] == "Drew bytes fetched per pixel to x.png"
    ran = rayfarm("heatmap", "cornell-box", *words, "--json", folder=tmp_path)
    drawn = json.loads(ran.out)
    assert (drawn["scale_max"], drawn["metric"], drawn["rays_kind"], drawn["size"]) == (
        123,
        "bytes",
        "primary",
        [16, 8],
    )


def test_a_failed_heatmap_ends_with_1_and_draws_nothing(tmp_path: Path) -> None:
    ran = rayfarm("heatmap", "cornell-box", "--size", "16", folder=tmp_path, environment=NO_GL)
    assert (ran.code, ran.out) == (1, "")
    assert "bvh-stack fragment normal failed: No OpenGL 4.3 context" in ran.err
    assert list(tmp_path.iterdir()) == []


BAD_HEATMAPS = {
    ("nowhere",): "There is no scene 'nowhere'",
    ("cornell-box", "--metric", "heat"): "Unknown metric 'heat': choose one of nodes, triangles, bytes.",
    ("cornell-box", "--output", "map.jpg"): "The picture 'map.jpg' is no PNG",
    ("cornell-box", "--output", "nowhere/map.png"): "There is no folder 'nowhere'",
    ("cornell-box", "--max", "0"): "Invalid value for '--max'",
    ("cornell-box", "--method", "hybrid", "--rays", "primary"): "hybrid rasterises what the eye sees",
    (
        "cornell-box",
        "--traversal",
        "all",
        "--method",
        "all",
        "--layout",
        "all",
    ): f"These are {len(matrix({axis: AXES[axis] for axis in ('traversal', 'method', 'layout')})[0])} maps",
}


@pytest.mark.parametrize(("words", "sentence"), BAD_HEATMAPS.items(), ids=[" ".join(words) for words in BAD_HEATMAPS])
def test_a_bad_heatmap_is_one_sentence(
    words: tuple[str, ...], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    check_refused("heatmap", words, sentence, capsys)
