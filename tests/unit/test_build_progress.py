"""What a long build tells as it goes on: shares that rise to the whole; a short one tells nothing."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from renderer.build import api, bvh, kd, progress, sbvh
from renderer.build.cache import Kind
from renderer.build.parallel import each
from renderer.build.progress import within
from renderer.build.tree import Builder

SEED, NUMBER = 31, 3000
CASES = [(kind, builder) for kind in get_args(Kind) for builder in get_args(Builder) if builder in api.BUILDERS[kind]]


@pytest.fixture(autouse=True)
def _many_tasks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAYFARM_CACHE", str(tmp_path))
    for module in (bvh, kd, sbvh):
        monkeypatch.setattr(module, "TASK", 200)


def built(kind: Kind, builder: Builder) -> list[str]:
    rng = np.random.default_rng(SEED)
    triangles = (rng.random((NUMBER, 1, 3)) + 0.02 * rng.random((NUMBER, 3, 3))).astype(np.float32)
    said: list[str] = []
    api.build("key", triangles, kind, builder, say=said.append)
    return said


@pytest.mark.parametrize(("kind", "builder"), CASES)
def test_shares_rise_to_the_whole(kind: Kind, builder: Builder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "EVERY_S", 0.0)
    said = built(kind, builder)
    named = {"bvh": "BVH", "kd": "KD-tree"}[kind]
    shape = re.compile(rf"building a {named} \({builder}\) over 3,000 triangles: (\d+) %")
    shares = [int(shape.fullmatch(text)[1]) for text in said]  # type: ignore[index]
    assert len(shares) > 5
    assert shares == sorted(shares)
    assert 0 < shares[0] < 70
    assert shares[-1] == 100
    assert built(kind, builder) == []  # It is kept.


def test_what_takes_no_second_tells_nothing() -> None:
    built("bvh", "sah")
    assert built("bvh", "binned") == []


@pytest.mark.parametrize("threads", ["1", "2"])
def test_a_part_tells_its_share_of_the_whole(threads: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAYFARM_BUILD_THREADS", threads)
    shares: list[float] = []
    assert each([lambda: "a", lambda: "b"], within(shares.append, 0.5, 0.9)) == ["a", "b"]
    assert shares == pytest.approx([0.7, 0.9])
