"""The texts of plans are valid ES 3.1, by the reference compiler."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hand_made import duplicates, scene
from running import catalogue_scene, prepared

from renderer.glsl import digest, flatten
from renderer.pairs import meeting
from renderer.plan import Plan
from renderer.planner import LOOP_BUDGET, Reads
from renderer.request import RAYS
from renderer.variant import AXES, TRAVERSALS, Variant, matrix
from scenes.scene import Scene

SUFFIX = {"vertex": "vert", "fragment": "frag", "compute": "comp"}


def validator() -> str:
    found = shutil.which("glslangValidator")
    if found is None:
        pytest.skip("glslangValidator is not here: install glslang-tools")
    return found


@cache
def scenes() -> tuple[Scene, ...]:
    """With vertex normals and without; two lights."""
    lights = ((0.0, 1.0, 2.0), (1.0, 1.0, 2.0))
    bare = scene("two lights", duplicates(3), lights=lights)
    return catalogue_scene("cornell-statue:2000"), catalogue_scene("cornell-box"), bare


@cache
def large() -> Scene:
    """More triangles than one brute-force pass tests."""
    return scene("passes", duplicates(LOOP_BUDGET))


AXES_OF_TEXTS = tuple(axis for axis in AXES if axis not in ("traversal", "builder"))


def variants(traversal: str, rays: str) -> list[Variant]:
    """A text is put together of a part for each axis."""
    valid = matrix({"traversal": (traversal,), **{axis: AXES[axis] for axis in AXES_OF_TEXTS}}, rays)[0]
    return meeting(valid, AXES_OF_TEXTS)


def plans(traversal: str) -> Iterator[Plan]:
    """Every plan of those variants: what is timed, instrumented, recording or not, fitted or general."""
    for rays in RAYS:
        for variant in variants(traversal, rays):
            for shown in (*scenes(), large()) if variant.structure == "none" else scenes():
                for specialise in (True, False):
                    ready = prepared(shown, variant, (64, 64), rays=rays, specialise=specialise)
                    yield ready.plan(instrument=True)
                    yield ready.plan(instrument=False)
                    yield ready.recording_plan(Reads(np.zeros(1, np.uint32), 1))


@pytest.mark.parametrize("traversal", TRAVERSALS)
def test_texts_are_valid(traversal: str, tmp_path: Path) -> None:
    for plan in plans(traversal):
        for program in plan.programs:
            for stage, text in program.stages.items():
                assert text.startswith("#version 310 es\n")
                (tmp_path / f"{digest(text)[:20]}.{SUFFIX[stage]}").write_text(text, encoding="utf-8")
    files = sorted(path.name for path in tmp_path.iterdir())
    assert {name.rpartition(".")[2] for name in files} == {"vert", "frag", "comp"}
    assert len(files) > 20
    done = subprocess.run([validator(), *files], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_the_validator_refuses_a_bad_text(tmp_path: Path) -> None:
    (tmp_path / "bad.comp").write_text(flatten({}, ["void main() { int i = 1.0; }\n"]), encoding="utf-8")
    done = subprocess.run([validator(), "bad.comp"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 2
