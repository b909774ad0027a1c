"""What the phone agent reads of a plan, and what it says of one that it cannot read or run."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from agent_desktop import Batch
from running import catalogue_scene, context, prepared

from renderer.plan import Buffer, Plan, PlanError, Program, Texture, load_plan
from renderer.twin import Twin
from renderer.variant import AXES, Variant

GOLDEN = Path(__file__).parent.parent / "fixtures" / "plan_v3.bin"
SIZE = (24, 16)


@pytest.fixture(scope="module")
def agent() -> Iterator[Batch]:
    with Batch() as batch:
        yield batch


def box(method: str = "fragment", *, instrument: bool = False, fetch: str = "storage") -> Plan:
    variant = Variant("bvh-stack", method, fetch=fetch)
    return prepared(catalogue_scene("cornell-box"), variant, SIZE).plan(instrument=instrument)


def read(agent: Batch, path: Path) -> Any:
    return json.loads(agent.ask({"plan": str(path)}))


def uniforms(found: list[dict[str, Any]]) -> dict[str, Any]:
    """By name; floats come as the shortest decimals that tell them apart from their neighbours."""
    return {u["name"]: (u["type"], [float(np.float32(x)) for x in u["floats"]] + u["ints"]) for u in found}


def in_words(kind: str, values: list[float]) -> tuple[str, list[float]]:
    """A uniform as 32-bit words hold it."""
    dtype = np.float32 if kind in ("float", "vec2", "vec3", "mat4") else np.uint32
    words = np.array(values).astype(dtype)
    return kind, [float(word) for word in words] if dtype == np.float32 else words.view(np.int32).tolist()


def test_the_pinned_bytes_are_read(agent: Batch) -> None:
    """The fixture that Python's own reader is held to."""
    plan, found = load_plan(GOLDEN), read(agent, GOLDEN)
    assert [found[name] for name in ("width", "height", "tileWidth", "tileHeight")] == [*plan.size, *plan.tile]
    held: list[Buffer | Texture] = [*plan.buffers, *plan.textures]
    data = {one.name: list(one.data.tobytes()) for one in held if one.data is not None}
    assert found["data"] == data
    assert [(b["name"], b["bytes"], b["offset"] < 0) for b in found["buffers"]] == [
        (b.name, b.nbytes, b.data is None) for b in plan.buffers
    ]
    told = {name: (texture["format"], texture["width"] or None) for name, texture in found["textures"].items()}
    assert told == {texture.name: (texture.format, texture.width) for texture in plan.textures}
    assert found["programs"] == {program.name: program.stages for program in plan.programs}
    assert (found["needs"], found["output"]) == (plan.needs, plan.output)
    assert uniforms(found["uniforms"]) == {name: in_words(*u) for name, u in plan.uniforms.items()}
    for step, expected in zip(found["passes"], plan.passes, strict=True):
        same = ("name", "kind", "program", "storage", "textures", "images", "target", "vertices", "collect")
        assert {name: step[name] for name in same} == {name: getattr(expected, name) for name in same}
        assert step["setup"] == (expected.phase == "setup")
        assert uniforms(step["uniforms"]) == {name: in_words(*u) for name, u in expected.uniforms.items()}


def test_the_pinned_plan_is_tried(agent: Batch) -> None:
    """Its programs hold nothing that links; the sentence names the first."""
    found = agent.run(GOLDEN)
    assert found.outcome == "failed"
    assert found.reason is not None
    assert found.reason.startswith("The program trace does not compile on this device: ")


def header_byte(data: bytearray) -> None:
    data[16] = ord("}")


def text_byte(data: bytearray) -> None:
    data[data.index(b"void main")] = ord("V")


def buffer_byte(data: bytearray) -> None:
    data[-20] ^= 1


def cut_header(data: bytearray) -> None:
    del data[500:]


def cut_buffers(data: bytearray) -> None:
    del data[-4000:]


def other_version(data: bytearray) -> None:
    struct.pack_into("<I", data, 8, 7)


def other_magic(data: bytearray) -> None:
    data[0] = 0


def nearly_empty(data: bytearray) -> None:
    del data[9:]


DAMAGES = (header_byte, text_byte, buffer_byte, cut_header, cut_buffers, other_version, other_magic, nearly_empty)


@pytest.mark.parametrize("damage", DAMAGES, ids=lambda damage: damage.__name__)
def test_a_damaged_plan_gets_the_sentence_that_python_has_for_it(
    agent: Batch, damage: Callable[[bytearray], None], tmp_path: Path
) -> None:
    torn = tmp_path / "torn"
    box().save(torn)
    data = bytearray(torn.read_bytes())
    damage(data)
    torn.write_bytes(data)
    with pytest.raises(PlanError) as expected:
        load_plan(torn)
    found = agent.run(torn)
    assert (found.outcome, found.reason) == ("failed", str(expected.value))


def test_a_plan_that_is_not_there_is_named(agent: Batch, tmp_path: Path) -> None:
    found = agent.run(tmp_path / "nowhere")
    assert (found.outcome, found.reason) == ("failed", "The plan nowhere cannot be read.")


@pytest.mark.parametrize("method", AXES["method"])
def test_without_fragment_storage_only_compute_runs(agent: Batch, method: str) -> None:
    found = agent.run(box(method), {"RAYFARM_SHIM_LIMITS": "MAX_FRAGMENT_SHADER_STORAGE_BLOCKS=0"})
    if method == "compute":
        assert (found.outcome, found.reason) == ("done", None)
        return
    assert found.outcome == "refused"
    assert found.reason == "This device offers GL_MAX_FRAGMENT_SHADER_STORAGE_BLOCKS = 0; the plan needs 2."
    assert found.device["limits"]["FRAGMENT_SHADER_STORAGE_BLOCKS"] == 0
    assert (found.compile_ms, found.upload_ms) == (0, 0)


@pytest.mark.parametrize("method", AXES["method"])
def test_without_fragment_storage_textures_are_fetched_from(agent: Batch, method: str) -> None:
    found = agent.run(box(method, fetch="texture"), {"RAYFARM_SHIM_LIMITS": "MAX_FRAGMENT_SHADER_STORAGE_BLOCKS=0"})
    assert (found.outcome, found.reason) == ("done", None)


def test_rows_that_a_texture_has_no_room_for_are_refused(agent: Batch) -> None:
    plan = box()
    tall = Texture("tall", "rgba32ui", 8, np.zeros(8 * 4 * 30 + 4, np.uint32))
    found = agent.run(replace(plan, textures=(*plan.textures, tall)), {"RAYFARM_SHIM_LIMITS": "MAX_TEXTURE_SIZE=30"})
    assert (found.outcome, found.reason) == (
        "refused",
        "This device offers GL_MAX_TEXTURE_SIZE = 30; the plan needs 31.",
    )


@pytest.mark.parametrize(
    ("limits", "said"),
    [
        ("MAX_SHADER_STORAGE_BLOCK_SIZE=100", "GL_MAX_SHADER_STORAGE_BLOCK_SIZE = 100"),
        ("MAX_SHADER_STORAGE_BUFFER_BINDINGS=4", "GL_MAX_SHADER_STORAGE_BUFFER_BINDINGS = 4; the plan needs 5"),
        ("MAX_TEXTURE_SIZE=16", "GL_MAX_TEXTURE_SIZE = 16; the plan needs 24"),
    ],
)
def test_other_limits_refuse_too(agent: Batch, limits: str, said: str) -> None:
    found = agent.run(box(instrument=True), {"RAYFARM_SHIM_LIMITS": limits})
    assert found.outcome == "refused"
    assert found.reason is not None
    assert said in found.reason


def test_a_limit_that_the_agent_does_not_know_is_not_passed_over(agent: Batch) -> None:
    found = agent.run(replace(box(), needs={"SPARKS": 1}))
    assert found.outcome == "refused"
    assert found.reason == "The plan needs GL_MAX_SPARKS = 1, a limit that this agent does not know."


def broken(stages: dict[str, str]) -> dict[str, str]:
    return {stage: text.replace("void main() {", "void main() { spark();") for stage, text in stages.items()}


@pytest.mark.parametrize("method", AXES["method"])
def test_a_text_that_does_not_compile_gets_the_twins_sentence(agent: Batch, method: str) -> None:
    plan = box(method)
    plan = replace(plan, programs=tuple(Program(p.name, broken(p.stages)) for p in plan.programs))
    with pytest.raises(PlanError) as expected:
        Twin(context(), plan)
    found = agent.run(plan)
    assert found.outcome == "failed"
    assert found.reason is not None
    assert found.reason.split(": ")[0] == str(expected.value).split(": ")[0]
    assert "spark" in found.reason


def test_an_error_of_opengl_is_named(agent: Batch) -> None:
    plan = box()
    found = agent.run(replace(plan, uniforms={**plan.uniforms, "eye": ("int", [1])}))
    assert found.outcome == "failed"
    assert found.reason == "OpenGL reports GL_INVALID_OPERATION while making the passes ready."


def test_a_name_that_the_plan_lacks_is_said(agent: Batch) -> None:
    plan = box()
    found = agent.run(replace(plan, passes=(replace(plan.passes[0], storage={"0": "nothing"}),)))
    assert found.outcome == "failed"
    assert found.reason == "The plan names 'nothing' and has nothing of that name."


def test_a_buffer_beyond_what_java_can_hold_is_refused(agent: Batch) -> None:
    plan = box()
    found = agent.run(replace(plan, buffers=(*plan.buffers, Buffer("huge", 1 << 31))))
    assert (found.outcome, found.reason) == (
        "refused",
        "The buffer huge has 2147483648 bytes; the agent takes 2147483647.",
    )
