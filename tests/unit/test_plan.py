"""The plan's file, the contract with every host: its bytes are pinned, and a damaged one is refused in a sentence."""

from __future__ import annotations

import hashlib
import json
import struct
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from renderer.plan import HEAD, MAGIC, VERSION, Buffer, Pass, Plan, PlanError, Program, Texture, load_plan
from renderer.twin import Twin, check_limits

GOLDEN = Path(__file__).parent.parent / "fixtures" / "plan_v3.bin"

TEXT = "#version 310 es\nvoid main() { }\n"
PLAN = Plan(
    size=(16, 8),
    tile=(8, 8),
    buffers=(
        Buffer("nodes", 20, np.array([1, 2, 3, 0xFFFFFFFF, 0x3F800000], np.uint32)),
        Buffer("primitives", 16, np.array([4, 5, 6, 7], np.uint32)),
        Buffer("empty", 0, np.zeros(0, np.uint32)),
        Buffer("state", 2048),
    ),
    textures=(
        Texture("image", "rgba8"),
        Texture("canvas", "rgba8"),
        Texture("depth", "depth24"),
        Texture("table", "rgba32ui", 2, np.arange(12, dtype=np.uint32)),
    ),
    programs=(
        Program("trace", {"compute": TEXT}),
        Program("present", {"vertex": TEXT, "fragment": TEXT + "// é\n"}),
    ),
    passes=(
        Pass(
            "primary",
            "compute",
            "trace",
            "setup",
            storage={"0": "nodes", "1": "primitives", "3": "state"},
            images={"0": "canvas", "1": "table"},
            uniforms={"range_first": ("uint", [0]), "range_last": ("uint", [4294967295])},
        ),
        Pass(
            "present",
            "draw",
            "present",
            textures={"canvas": "canvas", "table": "table"},
            target=["image"],
            collect="state",
        ),
        Pass("raster", "raster", "present", target=["image", "depth"], vertices="primitives"),
    ),
    uniforms={"eye": ("vec3", [0.1, -1e-30, 3.0]), "image_size": ("ivec2", [16, 8])},
    output="image",
    needs={"COMPUTE_SHADER_STORAGE_BLOCKS": 3, "SHADER_STORAGE_BLOCK_SIZE": 2048},
    left_out=("vertex normals in the primitive buffers",),
)


def parts(plan: Plan) -> dict[str, Any]:
    """Everything in a plan, in values that compare."""
    values = vars(plan) | {"buffers": [(b.name, b.nbytes) for b in plan.buffers]}
    values["textures"] = [(t.name, t.format, t.width, t.texels) for t in plan.textures]
    held: list[Buffer | Texture] = [*plan.buffers, *plan.textures]
    values["data"] = [None if one.data is None else one.data.tolist() for one in held]
    return values


def test_the_bytes_are_pinned(tmp_path: Path) -> None:
    PLAN.save(tmp_path / "plan")
    assert (tmp_path / "plan").read_bytes() == GOLDEN.read_bytes()


def test_the_pinned_bytes_are_the_plan() -> None:
    assert parts(load_plan(GOLDEN)) == parts(PLAN)
    assert load_plan(GOLDEN).shader_sha == PLAN.shader_sha


def test_the_layout_is_as_written_down() -> None:
    """What a host without Python relies on: magic, version, header's length and sha256, header, buffers by 16 bytes."""
    data = GOLDEN.read_bytes()
    assert data[:8] == MAGIC
    version, length = struct.unpack_from("<II", data, 8)
    assert version == VERSION == 3
    assert data[16:48] == hashlib.sha256(data[48 : 48 + length]).digest()
    header = json.loads(data[48 : 48 + length])
    offsets = {entry["name"]: (entry["offset"], entry["bytes"]) for entry in header["buffers"]}
    assert offsets == {"nodes": (0, 20), "primitives": (32, 16), "empty": (48, 0), "state": (None, 2048)}
    assert data[48 + length :][32:48] == struct.pack("<4I", 4, 5, 6, 7)
    assert {entry["name"]: entry["offset"] for entry in header["textures"] if entry["bytes"] is not None} == {
        "table": 48
    }
    assert data[48 + length :][48:96] == struct.pack("<12I", *range(12))
    assert len(data) == HEAD + length + 96
    assert len(data) < 4096


def test_a_plan_survives_its_file(tmp_path: Path) -> None:
    other = replace(PLAN, tile=(64, 32), left_out=(), uniforms={"lights": ("vec3", [float(i) / 3 for i in range(6)])})
    other.save(tmp_path / "plan")
    assert parts(load_plan(tmp_path / "plan")) == parts(other)


@pytest.mark.parametrize("kept", [0, 7, 12, 47])
def test_a_file_without_a_whole_head_is_no_plan(kept: int, tmp_path: Path) -> None:
    (tmp_path / "short").write_bytes(GOLDEN.read_bytes()[:kept])
    with pytest.raises(PlanError, match=r"^short is not a RayFarm plan\.$"):
        load_plan(tmp_path / "short")


def test_another_file_is_no_plan(tmp_path: Path) -> None:
    (tmp_path / "other").write_bytes(b"\x7fELF" + bytes(100))
    with pytest.raises(PlanError, match=r"^other is not a RayFarm plan\.$"):
        load_plan(tmp_path / "other")


def test_another_version_is_refused(tmp_path: Path) -> None:
    data = GOLDEN.read_bytes()
    (tmp_path / "new").write_bytes(data[:8] + struct.pack("<I", 1) + data[12:])
    with pytest.raises(PlanError, match=r"^new is a plan of version 1; this host reads version 3\.$"):
        load_plan(tmp_path / "new")


@pytest.mark.parametrize("kept", range(HEAD, len(GOLDEN.read_bytes()) if GOLDEN.exists() else 49, 97))
def test_a_torn_file_is_refused(kept: int, tmp_path: Path) -> None:
    (tmp_path / "torn").write_bytes(GOLDEN.read_bytes()[:kept])
    with pytest.raises(PlanError, match="torn"):
        load_plan(tmp_path / "torn")


@pytest.mark.parametrize("part", ["nodes", "primitives", "table", "header"])
def test_a_changed_byte_is_refused(part: str, tmp_path: Path) -> None:
    data = bytearray(GOLDEN.read_bytes())
    (length,) = struct.unpack_from("<I", data, 12)
    at = (
        {"nodes": 0, "primitives": 35, "table": 87, "header": data.index(b"void main") - 48 - length}[part]
        + 48
        + length
    )
    data[at] ^= 1
    (tmp_path / "changed").write_bytes(data)
    with pytest.raises(PlanError, match="torn: its header" if part == "header" else f"{part} fails its checksum"):
        load_plan(tmp_path / "changed")


def fake_device(**limits: int) -> Any:
    return SimpleNamespace(info={f"GL_MAX_{name}": value for name, value in limits.items()})


def test_a_device_below_a_limit_is_refused_by_the_limit_s_name() -> None:
    needs = replace(PLAN, needs={"FRAGMENT_SHADER_STORAGE_BLOCKS": 3})
    expected = "This device offers GL_MAX_FRAGMENT_SHADER_STORAGE_BLOCKS = 0; the plan needs 3."
    with pytest.raises(PlanError) as raised:
        check_limits(fake_device(FRAGMENT_SHADER_STORAGE_BLOCKS=0), needs)
    assert str(raised.value) == expected
    with pytest.raises(PlanError):
        Twin(fake_device(FRAGMENT_SHADER_STORAGE_BLOCKS=2), needs)


def test_a_device_at_the_limits_is_not_refused() -> None:
    check_limits(fake_device(COMPUTE_SHADER_STORAGE_BLOCKS=3, SHADER_STORAGE_BLOCK_SIZE=2048), PLAN)
    with pytest.raises(PlanError, match="GL_MAX_SHADER_STORAGE_BLOCK_SIZE = 2047; the plan needs 2048"):
        check_limits(fake_device(COMPUTE_SHADER_STORAGE_BLOCKS=3, SHADER_STORAGE_BLOCK_SIZE=2047), PLAN)


def test_a_tile_that_work_groups_overhang_is_refused() -> None:
    with pytest.raises(PlanError, match="multiple of 8"):
        replace(PLAN, size=(64, 64), tile=(60, 64))
