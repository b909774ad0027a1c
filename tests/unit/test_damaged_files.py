"""Hypothesis over all that reads files from elsewhere: damaged at random, each is read or refused in a sentence."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
import trimesh
from hypothesis import given, seed, settings
from hypothesis import strategies as st

from renderer.plan import PlanError, load_plan
from scenes.mesh import read_mesh
from scenes.scene import SceneError
from server.profiles.errors import ProfileError
from server.profiles.reader import read_profile

FIXTURES = Path(__file__).parents[1] / "fixtures"
SEED = 20_260_101
BOX = trimesh.creation.box()
MESHES = {kind: BOX.export(file_type=kind) for kind in ("obj", "ply", "stl", "off", "glb")}
PROFILES = [path.read_bytes() for path in sorted((FIXTURES / "profiles").glob("*.csv"))]
PLAN = (FIXTURES / "plan_v3.bin").read_bytes()
TOKENS = st.sampled_from(
    [b"", b"\n", b'"', b",", b"-1", b"nan", b"1e999", b"99999999999", b"\0", b"\xff", b"f 1 2 3\n"]
)
CUTS = st.lists(st.tuples(st.integers(0, 4000), st.integers(0, 40), st.binary(max_size=8) | TOKENS), max_size=6)
LIMITS = settings(max_examples=60, database=None, deadline=None)


def damaged(data: bytes, cuts: list[tuple[int, int, bytes]]) -> bytes:
    for at, length, new in cuts:
        place = at % (len(data) + 1)
        data = data[:place] + new + data[place + length :]
    return data


def one_sentence(error: BaseException) -> None:
    assert str(error).endswith((".", "?")), str(error)
    assert "\n" not in str(error)


@pytest.mark.parametrize("kind", MESHES)
def test_a_damaged_mesh_is_read_or_refused(kind: str) -> None:
    whole = MESHES[kind].encode() if isinstance(MESHES[kind], str) else bytes(MESHES[kind])

    @seed(SEED)
    @LIMITS
    @given(CUTS)
    def run(cuts: list[tuple[int, int, bytes]]) -> None:
        with TemporaryDirectory() as folder:
            path = Path(folder) / f"box.{kind}"
            path.write_bytes(damaged(whole, cuts))
            try:
                mesh = read_mesh(path)
            except SceneError as error:
                one_sentence(error)
            else:
                assert 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices)

    run()


@seed(SEED)
@LIMITS
@given(st.sampled_from(PROFILES), CUTS)
def test_a_damaged_profile_is_read_or_refused(whole: bytes, cuts: list[tuple[int, int, bytes]]) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "profile.csv"
        path.write_bytes(damaged(whole, cuts))
        try:
            found = read_profile(path)
        except ProfileError as error:
            one_sentence(error)
        else:
            assert all(one.min <= one.median <= one.max for one in found.summaries)


@seed(SEED)
@LIMITS
@given(CUTS)
def test_a_damaged_plan_is_read_or_refused(cuts: list[tuple[int, int, bytes]]) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "plan"
        path.write_bytes(damaged(PLAN, cuts))
        try:
            load_plan(path)
        except PlanError as error:
            one_sentence(error)


def test_units_of_several_lines_are_told_on_one(tmp_path: Path) -> None:
    path = tmp_path / "profile.csv"
    path.write_text('a,u,v\nreads,"B\nA",1\nreads,"B\nC",2\n')
    with pytest.raises(ProfileError) as refused:
        read_profile(path, column_map={"@metric": "a", "@unit": "u", "@value": "v"})
    one_sentence(refused.value)
