"""`rayfarm submit`: a study over HTTP."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from renderer.variant import AXES
from server.cli.axis_options import with_axes
from server.cli.common import SOME_FAILED, Client, ClientError, JsonFlag, ServerOption, make_console, print_json
from server.cli.follow import follow_study
from server.cli.table import print_comparison


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command()(with_axes(submit, dict.fromkeys(AXES)))


def submit(
    axes: dict[str, str | None],
    scene: Annotated[str | None, typer.Argument(help="Scenes of the catalogue, comma separated.")] = None,
    study: Annotated[str | None, typer.Option(help="A named study, as demo.")] = None,
    rays: Annotated[str | None, typer.Option(help="What is timed: primary, shadow or both.")] = None,
    size: Annotated[str | None, typer.Option(help="W or WxH, in pixels, or a comma list.")] = None,
    frames: Annotated[int | None, typer.Option(help="Timed frames over all rounds.")] = None,
    rounds: Annotated[int | None, typer.Option(help="Rounds, each in fresh processes.")] = None,
    sah: Annotated[str | None, typer.Option(help='The SAH\'s costs CT,CI, or several: "3.0,1.5; 1.5,3.0".')] = None,
    check: Annotated[str | None, typer.Option(help="none, oracle or referee.")] = None,
    vs_embree: Annotated[bool, typer.Option("--vs-embree", help="Trace the same rays with Embree.")] = False,
    specialise: Annotated[str | None, typer.Option(help="on, off or on,off.")] = None,
    models: Annotated[bool, typer.Option("--models", help="Also run the memory model and the ALU model.")] = False,
    gpu: Annotated[
        str | None,
        typer.Option(help="Compile for these GPUs, a comma list, and measure nothing.", show_default=False),
    ] = None,
    device: Annotated[str | None, typer.Option(help="llvmpipe, or devices as `rayfarm devices` lists them.")] = None,
    priority: Annotated[int | None, typer.Option(help="1 is the most urgent, 100 the usual.")] = None,
    wait: Annotated[bool, typer.Option("--wait/--no-wait", help="Wait for the results.")] = True,
    server: ServerOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Measure SCENE, or a named study, on a service; show progress, then the comparison."""
    chosen = _given({**axes, "sah": sah, "size": size, "specialise": specialise})
    body: dict[str, Any] = _given({"rays": rays, "frames": frames, "rounds": rounds, "check": check})
    body |= _given({"priority": priority, "devices": device, "gpus": gpu})
    body |= _given({"vs_embree": vs_embree or None, "models": models or None, "axes": chosen or None})
    body |= _what(scene, study)
    with Client(server) as client:
        posted = client.submit("studies", body)
        if wait:
            raise typer.Exit(show_study(client, posted, as_json))
        if as_json:
            print_json(posted)
        else:
            typer.echo(f"Submitted: {client.address}/studies/{posted['id']}")


def show_study(client: Client, posted: dict[str, Any], as_json: bool) -> int:
    """Follow a submitted study, print its comparison and where to see it; the exit code, 1 when a job failed."""
    console = make_console()
    if as_json:
        console.quiet = True
    for line in dict.fromkeys(f"Left out: {item['reason']}" for item in posted["refused"]):
        console.print(line, markup=False)
    study = follow_study(client, posted["id"], console)
    view = client.get(posted["results"].removeprefix("/api/v1/"))
    page = f"{client.address}{posted['page']}"
    if as_json:
        print_json({"study": study, "comparison": view, "page": page})
    else:
        print_comparison(view, console)
        typer.echo(f"See it at {page}")
    return SOME_FAILED if study["jobs_by_state"]["failed"] else 0


def _given(values: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in values.items() if value is not None}


def _what(scene: str | None, study: str | None) -> dict[str, Any]:
    if scene is None and study is None:
        raise ClientError("Name a scene, or a study with --study demo.")
    named = {} if scene is None else {"name": scene[:200], "scenes": scene}
    return named | ({} if study is None else {"name": study})
