"""Where Mesa's phone compilers are, and the environment that makes a process see one GPU."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from renderer.phone_compile.errors import CompileError
from renderer.phone_compile.gpus import Gpu
from scenes.kept import cache_folder

FOLDER_VARIABLE = "RAYFARM_PHONE_COMPILER"
HOW = "`make phone-compiler` builds them from Debian's source package of Mesa, in about 16 CPU minutes"


class MissingError(CompileError):
    """The tool chain is not here."""


@dataclass(frozen=True)
class ToolChain:
    """A folder that `tools/phone_compiler.sh` filled, and Mesa's version in it."""

    folder: Path
    version: str

    def environment(self, gpu: Gpu) -> dict[str, str]:
        """This process's environment, less what would steer Mesa elsewhere, with the no-op device of one GPU.

        A listing comes from a compiler that runs at once, in this process's order: no cache and no threads.
        """
        steering = ("MESA_", "LIBGL_", "EGL_", "GALLIUM_", "FD_", "IR3_", "PAN_", "BIFROST_", "LD_")
        kept = {name: value for name, value in os.environ.items() if not name.startswith(steering)}
        shim = "freedreno" if gpu.compiler == "ir3" else "panfrost"
        kept |= {
            "LD_LIBRARY_PATH": str(self.folder),
            "LD_PRELOAD": str(self.folder / f"lib{shim}_noop_drm_shim.so"),
            "MESA_SHADER_CACHE_DISABLE": "true",
        }
        if gpu.compiler == "ir3":
            return kept | {"FD_GPU_ID": gpu.number, "FD_MESA_DEBUG": "shaderdb", "IR3_SHADER_DEBUG": "vs,fs,cs"}
        return kept | {"PAN_GPU_ID": gpu.number, "BIFROST_MESA_DEBUG": "shaders,shaderdb"}


def tool_chain() -> ToolChain:
    """The tool chain of this machine; raise MissingError saying how to get it."""
    given = os.environ.get(FOLDER_VARIABLE)
    folder = Path(given).expanduser().resolve() if given else cache_folder("phone-compiler")
    try:
        version = (folder / "version").read_text(encoding="utf-8").strip()
    except OSError:
        where = f"{folder}, which {FOLDER_VARIABLE} names" if given else str(folder)
        raise MissingError(f"Mesa's compilers for phone GPUs are not in {where}: {HOW}.") from None
    return ToolChain(folder, version)
