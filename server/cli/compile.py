"""`rayfarm compile SCENE`: compiles variants for phone GPUs here, without a phone and without a server."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from renderer.phone_compile.gpus import USUAL
from renderer.variant import Variant
from server.cli.axis_options import with_axes
from server.cli.common import SOME_FAILED, make_console
from server.cli.options import CameraOption, OptionError, SahOption, SceneArgument, SizeOption

if TYPE_CHECKING:
    from server.cli.plan import Here

Json = dict[str, Any]


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("compile")(with_axes(compile_scene, Variant().as_dict()))


def compile_scene(
    scene: SceneArgument,
    axes: dict[str, str],
    gpu: Annotated[str, typer.Option(help="A GPU, a comma list, or all.", metavar="WORDS")] = ",".join(USUAL),
    rays: Annotated[str, typer.Option(help="What a frame casts: primary, shadow or both.")] = "both",
    size: SizeOption = "1024",
    sah: SahOption = "3.0,1.5",
    specialise: Annotated[str, typer.Option(help="on leaves out what the scene does not need, off keeps it.")] = "on",
    camera: CameraOption = None,
    threads: Annotated[int, typer.Option(help="Rasteriser threads of llvmpipe, which counts.")] = 2,
    disassembly: Annotated[
        bool, typer.Option("--disassembly", help="Add the GLSL, and each GPU's listing with how often its blocks run.")
    ] = False,
    output: Annotated[
        Path | None, typer.Option(help="Write the documents there, one of JSON a line.", show_default=False)
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print a line of JSON for each variant and GPU.")] = False,
) -> None:
    """Compile SCENE's variants for phone GPUs with Mesa's compilers, no phone needed: an estimate, not a measurement.

    Combinations that are refused are left out and listed. The exit code is 1 when a variant failed and 2 for bad input.
    """
    from renderer.child import ChildError
    from renderer.phone_compile.gpus import require_gpus
    from renderer.phone_compile.job import compile_request
    from renderer.phone_compile.toolchain import tool_chain
    from renderer.request import parse_size
    from server.cli.compile_table import print_estimates
    from server.cli.plan import plan_here, print_refused, read_camera, read_costs, read_switch
    from server.studies import Study

    gpus = require_gpus(gpu)
    tool_chain()
    study = Study(
        scenes=(scene,),
        axes=axes,
        size=parse_size(size),
        frames=1,
        rounds=1,
        rays=rays,
        costs=read_costs(sah),
        specialise=read_switch("specialise", specialise),
    )
    here = plan_here(study, read_camera(camera), threads)
    _require_writable(output)
    print_refused(here, as_json)
    documents: list[Json] = []
    failed = False
    with Console(stderr=True, quiet=as_json).status("") as status:
        for request in here.requests:
            status.update(request.variant.label)
            try:
                document = compile_request(request, gpus, disassembly=disassembly)
            except ChildError as error:
                failed = True
                _print_failure(request.variant.as_dict(), request.variant.label, str(error), as_json)
                continue
            documents.append(document)
            if as_json:
                for row in rows_of(document):
                    print(json.dumps(row, ensure_ascii=False), flush=True)
    if output is not None:
        output.write_text("".join(json.dumps(document) + "\n" for document in documents), encoding="utf-8")
    if documents and not as_json:
        print_estimates(_headline(here), documents, make_console())
    if failed:
        raise typer.Exit(SOME_FAILED)


def rows_of(document: Json) -> list[Json]:
    """A flat row for each GPU of a document, its axes first."""
    shared = {name: value for name, value in document.items() if name not in ("gpus", "glsl")}
    glsl = {"glsl": document["glsl"]} if "glsl" in document else {}
    return [{**shared, **row, **glsl} for row in document["gpus"]]


def _headline(here: Here) -> list[str]:
    first = here.requests[0]
    width, height = first.size
    return [f"{here.scene.name}: {len(here.scene.faces):,} triangles, {width}x{height}, {first.rays} rays"]


def _require_writable(output: Path | None) -> None:
    if output is not None and not output.parent.is_dir():
        raise OptionError(f"There is no folder {str(output.parent)!r}: make it, or choose another with --output.")


def _print_failure(axes: Json, label: str, reason: str, as_json: bool) -> None:
    line = json.dumps({"failed": axes, "reason": reason}) if as_json else f"{label} failed: {reason}"
    print(line, file=sys.stderr)
