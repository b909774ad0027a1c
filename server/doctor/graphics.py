"""EGL, llvmpipe and its limits, asked by `python -m server.doctor.graphics`: a driver may crash its process."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from typing import Any

from server.doctor.finding import Said

TIMEOUT_S = 60.0
TRIED = (22, 3)
"""The oldest Mesa that the tests run on."""
NEEDED = {
    "COMPUTE_SHADER_STORAGE_BLOCKS": 4,
    "FRAGMENT_SHADER_STORAGE_BLOCKS": 4,
    "SHADER_STORAGE_BUFFER_BINDINGS": 4,
    "SHADER_STORAGE_BLOCK_SIZE": 1 << 27,
    "COMPUTE_WORK_GROUP_INVOCATIONS": 128,
    "TEXTURE_SIZE": 2048,
}
"""OpenGL ES 3.1, table 20.40 and its neighbours, which every plan keeps to, and storage in the fragment stage."""
PACKAGES = "apt-get install libegl1 libgl1 libegl-mesa0 libgl1-mesa-dri"


def graphics() -> Iterator[Said]:
    """Whether llvmpipe can be had, and what it offers."""
    command = [sys.executable, "-m", "server.doctor.graphics"]
    try:
        ended = subprocess.run(command, capture_output=True, text=True, check=False, timeout=TIMEOUT_S)
        told = json.loads(ended.stdout or "null")
    except (subprocess.TimeoutExpired, ValueError):
        told = None
    if told is None:
        yield "missing", f"The OpenGL driver crashes or hangs: install Mesa anew ({PACKAGES}) and try again."
    elif "error" in told:
        yield "missing", f"{told['error'].rstrip('.')} ({PACKAGES})."
    else:
        yield from judged(told)


def judged(info: Mapping[str, Any]) -> Iterator[Said]:
    """What a context's strings and limits (`GL_...`) say."""
    renderer, version = info["GL_RENDERER"], info["GL_VERSION"]
    if "llvmpipe" not in renderer:
        yield "note", f"EGL gives {renderer}, not llvmpipe: set LIBGL_ALWAYS_SOFTWARE=1 to measure on llvmpipe."
    mesa = re.search(r"Mesa (\d+)\.(\d+)", version)
    if mesa and (int(mesa[1]), int(mesa[2])) < TRIED:
        least = ".".join(map(str, TRIED))
        yield "note", f"Mesa {mesa[1]}.{mesa[2]} is older than any that was tried: update it to {least} or later."
    lacking = [f"GL_MAX_{n} = {info.get(f'GL_MAX_{n}')}" for n, least in NEEDED.items() if _of(info, n) < least]
    if lacking:
        yield "missing", f"{renderer} offers less than OpenGL ES 3.1 must, {', '.join(lacking)}: install a later Mesa."
    else:
        yield "good", f"{renderer}, {version}, with the limits of OpenGL ES 3.1."


def _of(info: Mapping[str, Any], name: str) -> int:
    value = info.get(f"GL_MAX_{name}", 0)
    return value if isinstance(value, int) else 0


def _main() -> None:
    from renderer.plan import PlanError
    from renderer.twin import open_context

    try:
        told = {name: value for name, value in open_context().info.items() if isinstance(value, str | int)}
    except PlanError as error:
        told = {"error": str(error)}
    print(json.dumps(told))


if __name__ == "__main__":
    _main()
