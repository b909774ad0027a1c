"""In a copy of the program with the very lines of docs/adding_a_traversal.md and docs/adding_a_scene.md, and no other
change, everything has the new names, and the tests that are there hold the new traversal."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
import trimesh

ROOT = Path(__file__).parents[2]
COPIED = ("agent_android", "renderer", "scenes", "server", "shaders", "tests", "pyproject.toml")
NAME = "bvh-pop-stack"
TRAVERSAL = "shaders/traversal_bvh_pop_stack.glsl"

COMPARED = {"test_hand_made", "test_identity", "test_intersectors", "test_hard_cases", "test_watertight"}
MEASURED = {"test_addresses", "test_alu", "test_rays", "test_phone_estimates"}
SHAPED = {"test_builders", "test_depth", "test_limit", "test_variants", "test_shader_texts", "test_agent_identity"}

PAGES = """
import sys
from pathlib import Path
from service_fakes import running_service
with running_service(Path(sys.argv[1])) as service:
    for page in ("/submit", "/recommend"):
        assert f'value="{sys.argv[2]}"' in service.client.get(page).text, page
    study = {"scenes": ["cornell-box"], "axes": {"traversal": "all"}, "size": [64, 64]}
    planned = service.client.post("/api/v1/studies/plan", json=study | {"axes": {"traversal": sys.argv[2]}})
    assert planned.json()["jobs"] == 1, planned.text
    assert service.client.post("/api/v1/studies/plan", json=study).json()["jobs"] > 5
    assert service.client.get("/scenes/waves").status_code == 200
"""


def blocks(page: str, language: str) -> list[str]:
    """The code blocks of a page in one language."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def insert(path: Path, before: str, text: str) -> None:
    """Put a text before the one place where `before` stands in a file."""
    whole = path.read_text(encoding="utf-8")
    assert whole.count(before) == 1, path
    path.write_text(whole.replace(before, text + before), encoding="utf-8")


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A copy of the program with the traversal and the scenes of the two pages."""
    copied = tmp_path_factory.mktemp("copy")
    ignored = shutil.ignore_patterns("__pycache__", "build", ".*")
    for name in COPIED:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, copied / name, ignore=ignored)
        else:
            shutil.copy(ROOT / name, copied / name)
    (text,), (row,) = blocks("adding_a_traversal.md", "glsl"), blocks("adding_a_traversal.md", "python")
    (copied / TRAVERSAL).write_text(text, encoding="utf-8")
    insert(copied / "renderer/variant.py", '    "bvh-parent-link": ', row)
    pyramid, waves, entry = blocks("adding_a_scene.md", "python")
    insert(copied / "scenes/catalogue.py", "        CORNELL_BOX,\n", f"{pyramid.rstrip()},\n{entry.rstrip()},\n")
    insert(copied / "scenes/procedural.py", "def statue(", f"{waves}\n\n")
    yield copied
    shutil.rmtree(copied)


def ran(copy: Path, *words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Python in the copy, which shadows the installed packages."""
    path = os.pathsep.join([str(copy), str(copy / "tests"), str(copy / "tests/acceptance")])
    variables = {**os.environ, "PYTHONPATH": path, **environment}
    return subprocess.run(
        [sys.executable, *words], cwd=copy, env=variables, capture_output=True, text=True, check=False
    )


def run_tests(copy: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return ran(copy, "-m", "pytest", "-q", "-p", "no:cacheprovider", *words)


def rayfarm(copy: Path, *words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return ran(copy, "-c", "from server.cli.app import main; main()", *words, **environment)


def test_the_tests_of_a_traversal_come_by_themselves(copy: Path) -> None:
    listed = run_tests(copy, "--collect-only", "tests/gpu", "-k", NAME)
    assert listed.returncode == 0, listed.stdout
    by_file = Counter(re.findall(rf"^tests/gpu/(\w+)\.py::.*\b{NAME}\b", listed.stdout, re.MULTILINE))
    assert set(by_file) >= COMPARED | MEASURED | SHAPED
    assert by_file.total() > 250


def test_they_hold_the_new_traversal_against_brute_force(copy: Path) -> None:
    files = ("tests/gpu/test_hand_made.py", "tests/gpu/test_identity.py", "tests/unit/test_variant.py")
    chosen = f"({NAME} and (cornell-box or smaller_id or brute_force_finds and compute)) or every_traversal_has"
    passed = run_tests(copy, *files, "-k", chosen)
    assert passed.returncode == 0, passed.stdout
    found = re.search(r"(\d+) passed", passed.stdout)
    assert found is not None
    assert int(found.group(1)) > 20


def test_they_fail_for_one_that_loses_hits(copy: Path) -> None:
    path = copy / TRAVERSAL
    right = path.read_text(encoding="utf-8")
    try:
        path.write_text(right.replace("stack[top] = near ^ 1u;", "stack[top] = near;"), encoding="utf-8")
        failed = run_tests(copy, "tests/gpu/test_identity.py", "-k", f"brute_force_finds and cornell-box-{NAME}")
    finally:
        path.write_text(right, encoding="utf-8")
    assert failed.returncode == 1, failed.stdout
    assert "1 failed" in failed.stdout


def test_it_is_measured_and_judged_like_any_other(copy: Path) -> None:
    assert NAME in rayfarm(copy, "heatmap", "--help").stdout.replace("-\n", "-").replace(" ", "")
    words = f"cornell-box --traversal {NAME},bvh-stack --size 64 --frames 2 --rounds 1 --vs-embree --json"
    measured = rayfarm(copy, "bench", *words.split())
    assert measured.returncode == 0, measured.stderr
    mine, stack = (json.loads(line) for line in measured.stdout.splitlines())
    assert mine["traversal"] == NAME
    for name in ("false_hit", "false_miss", "wrong_primitive", "shadow_mismatch"):
        assert mine["error"][name] == 0
    assert mine["vs_embree"]["ratio"] > 0
    assert mine["rays"] == stack["rays"]
    assert 0.5 < mine["per_ray"]["nodes"] / stack["per_ray"]["nodes"] < 2
    pages = ran(copy, "-c", PAGES, str(copy), NAME)
    assert pages.returncode == 0, pages.stderr


def test_a_text_that_does_not_compile_is_told_with_its_line(copy: Path) -> None:
    path = copy / TRAVERSAL
    right = path.read_text(encoding="utf-8")
    try:
        path.write_text(right.replace("        uint link;\n", ""), encoding="utf-8")
        failed = rayfarm(copy, "bench", "cornell-box", "--traversal", NAME, "--size", "16", "--frames", "1")
    finally:
        path.write_text(right, encoding="utf-8")
    assert failed.returncode == 1
    assert "in `fetch_node(node, lower, upper, link);`" in failed.stderr


def test_scenes_are_listed_and_measured(copy: Path, tmp_path: Path) -> None:
    trimesh.creation.cone(0.8, 1.0, sections=3).export(tmp_path / "pyramid.ply")
    here = {"RAYFARM_SCENES": str(tmp_path)}
    listed = json.loads(rayfarm(copy, "scenes", "--json", **here).stdout)
    assert {row["name"] for row in listed if row["here"]} >= {"pyramid", "waves"}
    for name, triangles in (("pyramid", 6), ("waves:5000", 5000)):
        measured = rayfarm(copy, "bench", name, "--size", "32", "--frames", "1", "--json", **here)
        assert measured.returncode == 0, measured.stderr
        assert json.loads(measured.stdout)["triangles"] == triangles
    views = run_tests(copy, "tests/unit/test_scenes_views.py", "-k", "waves")
    assert "1 passed" in views.stdout, views.stdout
