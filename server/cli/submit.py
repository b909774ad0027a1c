"""`rayfarm submit`: a study over HTTP."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from renderer.variant import AXES
from server.cli.common import SOME_FAILED, Client, ClientError, JsonFlag, ServerOption, make_console, print_json
from server.cli.follow import follow_study
from server.cli.table import print_comparison

STUDY_AXES = (*AXES, "sah", "size", "specialise")
Words = Annotated[str | None, typer.Option(help="A value, a comma list, paper or all.", show_default=False)]


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command()(submit)


def submit(
    scene: Annotated[str | None, typer.Argument(help="Scenes of the catalogue, comma separated.")] = None,
    study: Annotated[str | None, typer.Option(help="A named study, as demo.")] = None,
    traversal: Words = None,
    method: Words = None,
    layout: Words = None,
    intersector: Words = None,
    box: Words = None,
    nodes: Words = None,
    precision: Words = None,
    offset: Words = None,
    builder: Words = None,
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
    given = locals()
    axes = {axis: given[axis] for axis in STUDY_AXES if given[axis] is not None}
    names = ("rays", "frames", "rounds", "check", "priority")
    plain = {name: given[name] for name in names} | {"devices": device, "gpus": gpu}
    body = {name: value for name, value in plain.items() if value is not None}
    body |= {name: True for name in ("vs_embree", "models") if given[name]}
    body |= {"axes": axes} if axes else {}
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


def _what(scene: str | None, study: str | None) -> dict[str, Any]:
    if scene is None and study is None:
        raise ClientError("Name a scene, or a study with --study demo.")
    named = {} if scene is None else {"name": scene[:200], "scenes": scene}
    return named | ({} if study is None else {"name": study})
