"""GLSL to SPIR-V by the reference compiler, unoptimised, kept for this process."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from functools import lru_cache
from pathlib import Path

from renderer.alu.errors import ModelError

COMPILER = "glslangValidator"
_STAGES = {"fragment": "frag", "compute": "comp", "vertex": "vert"}

# SPIR-V needs the locations and bindings that ES 3.1 lets a text leave out; functions that nothing calls are kept, as
# the marks of what a plan leaves out say how many words it would have fetched.
_FLAGS = ("-G", "--target-env", "opengl", "--aml", "--amb", "--keep-uncalled", "--stdin")
_LIMIT_S = 60.0


@lru_cache(maxsize=64)
def compile_spirv(text: str, stage: str) -> bytes:
    """The SPIR-V of an ES 3.1 text; `stage` is `fragment`, `compute` or `vertex`.

    Raises ModelError where the compiler is not here or refuses the text.
    """
    found = shutil.which(COMPILER)
    if found is None:
        raise ModelError(f"The ALU model needs {COMPILER}: install the package glslang-tools.")
    with tempfile.TemporaryDirectory(prefix="rayfarm-spirv-") as folder:
        out = Path(folder) / "text.spv"
        command = [found, *_FLAGS, "-S", _STAGES[stage], "-o", str(out)]
        try:
            done = subprocess.run(command, input=text, capture_output=True, text=True, timeout=_LIMIT_S, check=False)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise ModelError(f"{COMPILER} could not be run to its end: {error}.") from error
        if done.returncode or not out.is_file():
            lines = [line for line in done.stdout.splitlines() if line.startswith("ERROR")]
            raise ModelError(f"{COMPILER} refuses the text: {(lines or ['no reason given'])[0]}.")
        return out.read_bytes()
