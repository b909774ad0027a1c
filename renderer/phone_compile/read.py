"""A driver's listings, whatever its family."""

from __future__ import annotations

from renderer.phone_compile.compiled import Compiled
from renderer.phone_compile.errors import CompileError
from renderer.phone_compile.gpus import Gpu
from renderer.phone_compile.ir3 import read_ir3
from renderer.phone_compile.listing import Listing
from renderer.phone_compile.mali import read_mali


def read_listing(gpu: Gpu, compiled: Compiled, stage: str) -> Listing:
    """The listing of one stage of a program; raise CompileError where the driver refused it or it is misread."""
    if compiled.complaint is not None:
        raise CompileError(f"{gpu.name} does not compile this: {compiled.complaint.rstrip('.')}.")
    if gpu.family == "ir3":
        found = read_ir3(compiled.listing, compiled.messages)
    else:
        found = read_mali(gpu.family, compiled.listing)
    for listing in found:
        if listing.stage == stage:
            return listing
    raise CompileError(f"Mesa's driver for {gpu.name} printed no {stage} shader.")
