"""`rayfarm bench SCENE`: measures here, without a server."""

from __future__ import annotations

import json
import sys
from functools import partial
from typing import TYPE_CHECKING, Annotated, cast

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from renderer.variant import Variant
from server.cli import heatmap as cli_heatmap
from server.cli.axis_options import with_axes
from server.cli.common import SOME_FAILED, make_console
from server.cli.options import CameraOption, OptionError, SahOption, SceneArgument, SizeOption

if TYPE_CHECKING:
    from collections.abc import Callable

    from renderer.bench import Result
    from renderer.child import ChildError
    from renderer.request import Check, Request
    from server.cli.plan import Here

ROUNDS = 4

RoundsOption = Annotated[
    int | None,
    typer.Option(
        help=f"Rounds, each in fresh processes; by default {ROUNDS}, or as few as the frames.", show_default=False
    ),
]
DeviceOption = Annotated[
    str | None,
    typer.Option("--device", help="Measure on the phone with this serial (`adb devices`).", show_default=False),
]
JsonLines = Annotated[
    bool,
    typer.Option(
        "--json",
        help="Print each result as a line of JSON; standard error then has a line of JSON with `refused` or `failed`, "
        "the axes, and `reason` for each variant without a result; and `warning`.",
    ),
]


def register(app: typer.Typer) -> None:
    """Add `bench` and `heatmap`."""
    app.command()(with_axes(bench, Variant().as_dict()))
    cli_heatmap.register(app)


def bench(
    scene: SceneArgument,
    axes: dict[str, str],
    rays: Annotated[str, typer.Option(help="What is timed: primary, shadow or both.")] = "both",
    size: SizeOption = "1024",
    frames: Annotated[int, typer.Option(help="Timed frames over all rounds.")] = 12,
    rounds: RoundsOption = None,
    sah: SahOption = "3.0,1.5",
    check: Annotated[
        str,
        typer.Option(
            help="Who judges: none, oracle, referee, or image (the referee, and the picture by FLIP and PSNR)."
        ),
    ] = "referee",
    vs_embree: Annotated[bool, typer.Option("--vs-embree", help="Trace the very same rays with Embree.")] = False,
    specialise: Annotated[str, typer.Option(help="on leaves out what the scene does not need, off keeps it.")] = "on",
    camera: CameraOption = None,
    threads: Annotated[int, typer.Option(help="Rasteriser threads of llvmpipe.")] = 1,
    models: Annotated[
        bool, typer.Option("--models", help="Run the models of memory lines and ALU operations too.")
    ] = False,
    device: DeviceOption = None,
    via: Annotated[str, typer.Option(help="How the agent comes into the phone: shell or apk.")] = "shell",
    as_json: JsonLines = False,
) -> None:
    """Measure SCENE here or on a phone, without a server.

    Combinations that are refused are left out and listed; `all` leaves out what tests every triangle above 10^9
    ray-triangle tests a frame. The exit code is 1 when a variant failed and 2 for bad input.
    """
    from renderer.request import parse_size
    from server.cli.plan import plan_here, print_refused, read_camera, read_costs, read_switch
    from server.studies import Study

    study = Study(
        scenes=(scene,),
        axes=axes,
        size=parse_size(size),
        frames=frames,
        rounds=_rounds(rounds, frames),
        rays=rays,
        costs=read_costs(sah),
        check=cast("Check", check),
        vs_embree=vs_embree,
        specialise=read_switch("specialise", specialise),
        models=models,
    )
    run = _slices_on(device, via)
    here = plan_here(study, read_camera(camera), threads)
    print_refused(here, as_json)
    _warn_slow(here, as_json)
    results = _run(here, run, quiet=as_json)
    _print_results(here, [result for result in results if isinstance(result, dict)], as_json)
    failures = [(r, e) for r, e in zip(here.requests, results, strict=True) if not isinstance(e, dict)]
    for request, error in failures:
        _print_failure(request, error, as_json)
    if failures:
        raise typer.Exit(SOME_FAILED)


def _rounds(rounds: int | None, frames: int) -> int:
    if rounds is None:
        return min(ROUNDS, frames)
    if not 1 <= rounds <= max(frames, 1):
        raise OptionError(f"The rounds are {rounds}: give a whole number from 1 to the frames, {frames}.")
    return rounds


def _warn_slow(here: Here, as_json: bool) -> None:
    """Tell how long brute force will take where it was asked for by name."""
    from server.cli.plan import slow_warning

    request = here.requests[0]
    # Warm-up frames of every round, and the instrumented frames beside them.
    untimed = request.rounds * (2 if request.vs_embree else 1) + 1
    warning = slow_warning(here, request.frames + untimed)
    if warning is not None:
        print(json.dumps({"warning": warning}) if as_json else f"Warning: {warning}", file=sys.stderr)


def _slices_on(device: str | None, via: str) -> Callable[..., Result]:
    """What measures a slice and takes a `note`: the twin here, or a phone. Raise PlanError for one that cannot be."""
    if device is None:
        from renderer.bench import run_slice

        return run_slice
    from server.devices.agent_host import AgentHost
    from server.devices.phone_slice import run_phone_slice

    AgentHost(device, via)
    return partial(run_phone_slice, device, via)


def _run(here: Here, run: Callable[..., Result], *, quiet: bool) -> list[Result | ChildError]:
    from renderer.bench import run_jobs

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("slices"))
    with Progress(*columns, TimeElapsedColumn(), console=Console(stderr=True, quiet=quiet)) as progress:
        total = sum(request.rounds for request in here.requests)
        task = progress.add_task("", total=total)
        begun = iter(range(total))
        named = ""

        def show(request: Request, round_index: int) -> None:
            nonlocal named
            named = f"{request.variant.label}, round {round_index + 1} of {request.rounds}"
            progress.update(task, description=named, completed=next(begun))

        def hear(text: str) -> None:
            progress.update(task, description=f"{named}, {text}")

        results = run_jobs(here.requests, show, partial(run, note=hear))
        progress.update(task, description="measured", completed=total)
        return results


def _print_results(here: Here, results: list[Result], as_json: bool) -> None:
    if as_json:
        for result in results:
            print(json.dumps(result, ensure_ascii=False))
    elif results:
        from server.cli.bench_table import print_results

        print_results(here.scene, results, make_console())


def _print_failure(request: Request, error: ChildError, as_json: bool) -> None:
    if as_json:
        line = json.dumps({"failed": request.variant.as_dict(), "reason": str(error)}, ensure_ascii=False)
    else:
        line = f"{request.variant.label} failed: {error}"
    print(line, file=sys.stderr)
