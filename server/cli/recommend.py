"""`rayfarm recommend SCENE`: the fastest variant within budgets, here or on a service."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from server.cli.axis_options import with_axes
from server.cli.common import SOME_FAILED, Client, ClientError, make_console, print_json
from server.cli.options import CameraOption, SahOption, SceneArgument, SizeOption
from server.considered import considered
from server.store.defaults import LLVMPIPE

if TYPE_CHECKING:
    from renderer.recommend.query import Query
    from server.cli.plan import Here
    from server.recommendations import Wanted

LIMIT_S = 4 * 3600.0
Json = dict[str, Any]


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command()(with_axes(recommend, considered()))


def recommend(
    scene: SceneArgument,
    axes: dict[str, str],
    device: Annotated[
        str | None,
        typer.Option(
            help="A phone's serial (`adb devices`); with --server a device as `rayfarm devices` lists it.",
            show_default=False,
        ),
    ] = None,
    error_budget: Annotated[
        float, typer.Option(help="The largest fraction of rays that may be wrong, edges not counted.")
    ] = 1e-3,
    memory_budget: Annotated[
        str | None, typer.Option(help="The most memory of its buffers, as 128M or 1.5G.", show_default=False)
    ] = None,
    rays: Annotated[str, typer.Option(help="What is timed: primary, shadow or both.")] = "both",
    size: SizeOption = "1024",
    rounds: Annotated[int, typer.Option(help="Rounds of the confirmation at the full size; 7 give an interval.")] = 8,
    sah: SahOption = "3.0,1.5",
    camera: CameraOption = None,
    threads: Annotated[int, typer.Option(help="Rasteriser threads of llvmpipe.")] = 1,
    seed: Annotated[int, typer.Option(help="Of the orders in which a round measures.")] = 1,
    via: Annotated[str, typer.Option(help="How the agent comes into the phone: shell or apk.")] = "shell",
    server: Annotated[str | None, typer.Option(help="Run it on a service instead of here.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")] = False,
) -> None:
    """Name the fastest variant for SCENE on a device, within an error budget and a memory budget.

    A pilot with small images drops what is clearly slower and leaves about a third of the field each time; the last few
    are measured side by side at the full size. Axes take a value, a comma list, paper or all. The exit code is 1 when
    nothing that was considered runs within the budgets.
    """
    from renderer.recommend.query import read_bytes
    from renderer.request import parse_size
    from server.cli.plan import read_camera, read_costs
    from server.recommendations import Wanted

    wanted = Wanted(
        scene,
        axes,
        parse_size(size),
        rays,
        read_costs(sah),
        error_budget,
        None if memory_budget is None else read_bytes(memory_budget),
        rounds,
        seed,
        read_camera(camera),
    )
    if server is None:
        found = _here(wanted, threads, device, via, as_json)
    else:
        if threads != 1:
            raise ClientError("--threads is for recommendations that run here: leave it out with --server.")
        found = _there(wanted, device or LLVMPIPE, server, as_json)
    if as_json:
        print_json(found)
    else:
        from server.cli.recommend_table import print_recommendation

        print_recommendation(found, make_console())
    if found["pick"] is None:
        raise typer.Exit(SOME_FAILED)


def _here(wanted: Wanted, threads: int, device: str | None, via: str, as_json: bool) -> Json:
    from server.cli.plan import plan_here
    from server.recommendations import query_of, study_of

    here = plan_here(study_of(wanted), wanted.camera, threads)
    query = query_of(wanted, here.requests)
    found = _run(query, device, via, quiet=as_json)
    return found | {"refused": _refused(here)}


def _refused(here: Here) -> list[Json]:
    return [{**variant.as_dict(), "reason": reason} for variant, reason in here.refused]


def _run(query: Query, device: str | None, via: str, *, quiet: bool) -> Json:
    from renderer.child import run_child

    module = "renderer.recommend.task"
    task: Json = {"query": query.to_json()}
    if device is not None:
        from server.devices.agent_host import DEADLINE_S, AgentHost

        AgentHost(device, via)
        module = "server.devices.phone_recommending"
        task |= {"serial": device, "via": via, "deadline_s": DEADLINE_S}
    with Console(stderr=True, quiet=quiet).status("starting") as status:
        return run_child(module, task, query.requests[0].threads, LIMIT_S, note=status.update)


def _there(wanted: Wanted, device: str, server: str, as_json: bool) -> Json:
    from server.cli.events import follow_events

    body = {
        "scene": wanted.scene,
        "axes": dict(wanted.axes),
        "size": list(wanted.size),
        "rays": wanted.rays,
        "sah": {"traversal": wanted.costs.traversal, "intersection": wanted.costs.intersection},
        "error_budget": wanted.error,
        "memory_budget": wanted.memory,
        "rounds": wanted.rounds,
        "seed": wanted.seed,
        "device": device,
    }
    if wanted.camera is not None:
        camera = wanted.camera
        body["camera"] = {"eye": camera.eye, "target": camera.target, "fov": camera.fov, "up": camera.up}
    with Client(server) as client:
        posted = client.submit("recommendations", body)
        page = f"{client.address}{posted['page']}"
        with Console(stderr=True, quiet=as_json).status(f"queued: {page}") as status:
            for change in follow_events(client, f"jobs/{posted['id']}/events"):
                status.update(f"{change['state']}: {change['reason'] or ''} {page}")
        view: Json = client.get(f"recommendations/{posted['id']}")
    if view["recommendation"] is None:
        raise ClientError(f"The recommendation {view['id']} is {view['state']}: {view['reason'] or 'no reason given'}")
    print(json.dumps({"page": page}) if as_json else f"See it at {page}", file=sys.stderr)
    found: Json = view["recommendation"] | {"refused": view["refused"]}
    return found
