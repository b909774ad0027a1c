"""`rayfarm compile` as a user runs it, with real compilers."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from renderer.phone_compile.toolchain import MissingError, tool_chain

COLUMNS = (
    "traversal", "method", "layout", "gpu", "instructions", "alu_per_fragment", "memory_per_fragment", "registers",
    "waves", "spills", "limit",
)  # fmt: skip


@pytest.fixture(autouse=True)
def _compilers() -> None:
    try:
        tool_chain()
    except MissingError as error:
        pytest.skip(str(error))


def run(*words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "server.cli.app", "compile", "cornell-box", "--size", "24", *words]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)


def test_a_row_for_each_variant_and_gpu() -> None:
    done = run("--traversal", "bvh-stack,kd-push-down", "--layout", "split", "--gpu", "adreno-540,mali-g72", "--json")
    assert done.returncode == 0, done.stderr
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert [(row["traversal"], row["gpu"]) for row in rows] == [
        ("bvh-stack", "adreno-540"),
        ("bvh-stack", "mali-g72"),
        ("kd-push-down", "adreno-540"),
        ("kd-push-down", "mali-g72"),
    ]
    for row in rows:
        assert set(COLUMNS) <= set(row)
        assert row["limit"] is None
        assert row["reason"] is None
        assert row["alu_per_fragment"] > 100
        assert row["label"] in ("Mesa ir3 estimate", "Mesa panfrost estimate")
        assert "disassembly" not in row


def test_a_table_and_a_file_with_listings(tmp_path: Path) -> None:
    output = tmp_path / "compiled.jsonl"
    done = run("--gpu", "adreno-540", "--disassembly", "--output", str(output))
    assert done.returncode == 0, done.stderr
    assert "Mesa ir3 estimate, Mesa " in done.stdout
    assert "adreno-540" in done.stdout
    (document,) = [json.loads(line) for line in output.read_text().splitlines()]
    assert document["glsl"].startswith("#version 310 es")
    assert document["gpus"][0]["disassembly"][-1].endswith("end")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--gpu", "adreno-9"), "rayfarm: Unknown GPU 'adreno-9': choose of adreno-510"),
        (("--output", "/no/such/folder/x"), "rayfarm: There is no folder '/no/such/folder'"),
    ],
)
def test_bad_input_is_one_sentence(words: tuple[str, ...], sentence: str) -> None:
    done = run(*words)
    assert done.returncode == 2
    assert done.stderr.startswith(sentence)
