"""Drivers that crash, hang and say nothing; a tool chain that is not there; what is asked for."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from renderer.phone_compile.compiled import compile_programs
from renderer.phone_compile.errors import CompileError
from renderer.phone_compile.gpus import GPUS, USUAL, require_gpus
from renderer.phone_compile.sites import Where, counting_text, marked_text, sites_of
from renderer.phone_compile.toolchain import MissingError, ToolChain, tool_chain
from renderer.request import Request, RequestError

GPU = GPUS["adreno-540"]
FACTS = '{"renderer": "FD540", "version": "3.1", "limits": {"COMPUTE_SHADER_STORAGE_BLOCKS": 12}}'
ONE = '{"complaint": null, "messages": [], "listing": "first"}'
TEXT = """#version 310 es
precision highp float;
void step() {
    while (more()) {
        go();
    }
}
void trace(const bool any_hit) {
    if (any_hit) {
        step();
    }
}
void main() {
    trace(false);
    for (int l = 0; l < 2; l++) {
        trace(true);
    }
}
"""


def fake(folder: Path, body: str, monkeypatch: pytest.MonkeyPatch) -> str:
    """A driver that says what `body` prints."""
    (folder / "fake_driver.py").write_text(
        f"import os, signal, sys, time\nsys.stdin.readline()\ndef say(line): print(line, flush=True)\n{body}\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(folder))
    return "fake_driver"


def test_a_driver_that_crashes_leaves_what_it_had(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    body = f"say('{FACTS}'); say('{ONE}'); os.kill(os.getpid(), signal.SIGSEGV)"
    module = fake(tmp_path, body, monkeypatch)
    answer = compile_programs(ToolChain(tmp_path, "25.0.7"), GPU, [{}, {}], module=module)
    assert [program.listing for program in answer.programs] == ["first"]
    assert answer.ended == "Mesa's driver for adreno-540 crashed on this text (signal 11)."


def test_a_driver_that_hangs_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = fake(tmp_path, f"say('{FACTS}'); say('{ONE}'); time.sleep(60)", monkeypatch)
    answer = compile_programs(ToolChain(tmp_path, "25.0.7"), GPU, [{}, {}], 2.0, module)
    assert len(answer.programs) == 1
    assert answer.ended == "Mesa's driver for adreno-540 was ended after 2 s: it hangs on this text."


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ("sys.exit(3)", r"crashed on this text \(code 3\)\.$"),
        ("""say('{"error": "EGL gives no surfaceless display (error 0x3001)"}')""", "gives nothing: EGL gives no"),
        ("say('what a library prints')", "gave no answer"),
        (f"say('{FACTS}'.replace('FD540', 'llvmpipe'))", "came up as llvmpipe: build the compilers again"),
    ],
)
def test_a_driver_that_cannot_be_asked(
    body: str, sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = fake(tmp_path, body, monkeypatch)
    with pytest.raises(CompileError, match=sentence):
        compile_programs(ToolChain(tmp_path, "25.0.7"), GPU, [{}], module=module)


def test_a_missing_tool_chain_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAYFARM_PHONE_COMPILER", str(tmp_path))
    with pytest.raises(MissingError, match="`make phone-compiler` builds them from Debian's source package"):
        tool_chain()


def test_the_command_line_says_so_too(tmp_path: Path) -> None:
    environment = os.environ | {"RAYFARM_PHONE_COMPILER": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-m", "server.cli.app", "compile", "cornell-box"],
        capture_output=True, text=True, env=environment, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.startswith("rayfarm: Mesa's compilers for phone GPUs are not in")
    assert len(done.stderr.splitlines()) == 1


def test_a_process_sees_one_gpu_and_no_other_mesa(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MESA_LOADER_DRIVER_OVERRIDE", "swrast")
    environment = ToolChain(tmp_path, "25.0.7").environment(GPU)
    assert environment["FD_GPU_ID"] == "540"
    assert "MESA_LOADER_DRIVER_OVERRIDE" not in environment


def test_gpus_are_named() -> None:
    assert [gpu.name for gpu in require_gpus("Adreno-540, mali-g57,adreno-540")] == ["adreno-540", "mali-g57"]
    assert len(require_gpus("all")) == len(GPUS)
    assert set(USUAL) <= set(GPUS)
    for words in ("adreno-9", " , "):
        with pytest.raises(CompileError, match="choose of adreno-510"):
            require_gpus(words)


def test_a_request_that_compiles_times_nothing() -> None:
    request = Request("cornell-box", frames=1, rounds=1, gpus=("adreno-540",))
    assert Request.from_json(request.to_json()) == request
    with pytest.raises(RequestError, match="leave frames and rounds out"):
        Request("cornell-box", gpus=("adreno-540",))
    with pytest.raises(RequestError, match="Unknown GPU"):
        Request("cornell-box", frames=1, rounds=1, gpus=("adreno-9",))


def test_sites_are_told_apart_by_the_ray_they_serve() -> None:
    assert sites_of(TEXT) == [Where(0, False), Where(0, True), Where(1, False), Where(1, True), Where(2, False)]
    counted, marked = counting_text(TEXT), marked_text(TEXT, [Where(0, True), Where(2, False)])
    assert counted.count("atomicAdd(executed[") == 6
    assert counted.index("precision") < counted.index("buffer Executed") < counted.index("void step()")
    assert "while (more()) { if (site_shadow) { atomicAdd(marked[0], 1u); }" in marked
    assert "if (any_hit) { \n" in marked
    assert "l++) { atomicAdd(marked[2], 1u);" in marked
    assert "site_shadow = true; trace(true);" in marked
