"""`rayfarm heatmap SCENE`: the paper's node-traversal heatmap, several variants side by side on one scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.status import Status

from renderer.variant import Variant
from server.cli.axis_options import with_axes
from server.cli.common import SOME_FAILED, JsonFlag, print_json
from server.cli.options import CameraOption, OptionError, SahOption, SceneArgument, SizeOption

if TYPE_CHECKING:
    from renderer.pictures.counts import Counts
    from renderer.request import Request
    from server.cli.plan import Here

Json = dict[str, Any]

MOST = 24
"""The most maps in one picture."""

RAYS = {"primary": "primary rays", "shadow": "shadow rays", "both": "primary and shadow rays"}


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command()(with_axes(heatmap, Variant().as_dict()))


def heatmap(
    scene: SceneArgument,
    axes: dict[str, str],
    rays: Annotated[str, typer.Option(help="Whose work is counted: primary, shadow or both.")] = "both",
    size: SizeOption = "1024",
    sah: SahOption = "3.0,1.5",
    camera: CameraOption = None,
    metric: Annotated[str, typer.Option(help="What is counted: nodes, triangles or bytes.")] = "nodes",
    top: Annotated[
        int | None,
        typer.Option("--max", min=1, help="The scale's top; by default one that holds 99.5 % of each map's pixels."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option(help="The PNG to write; by default heatmap-SCENE.png here.", show_default=False)
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Draw how many nodes every pixel's rays fetch, several variants side by side on one scale."""
    from renderer.pictures.heatmap import require_metric
    from renderer.request import parse_size
    from server.cli.plan import plan_here, print_refused, read_camera, read_costs
    from server.studies import Study

    require_metric(metric)
    study = Study((scene,), axes, size=parse_size(size), frames=1, rounds=1, rays=rays, costs=read_costs(sah))
    here = plan_here(study, read_camera(camera))
    path = _writable(output or Path(f"heatmap-{Path(here.scene.name).stem}.png"))
    if len(here.requests) > MOST:
        raise OptionError(f"These are {len(here.requests)} maps and one picture holds {MOST}: name fewer variants.")
    print_refused(here, as_json)
    maps = _count(here, metric, quiet=as_json)
    _show(here, maps, metric, top, path, as_json)


def _writable(path: Path) -> Path:
    if path.suffix.lower() != ".png":
        raise OptionError(f"The picture {str(path)!r} is no PNG: end its name in .png.")
    if not path.parent.is_dir():
        raise OptionError(f"There is no folder {str(path.parent)!r}: make it, or choose another with --output.")
    return path


def _count(here: Here, metric: str, *, quiet: bool) -> list[Counts]:
    from renderer.child import ChildError
    from renderer.pictures.heatmap import heatmap as count

    maps = []
    with Console(stderr=True, quiet=quiet).status("") as status:
        for request in here.requests:
            label = request.variant.label
            status.update(label)
            try:
                maps.append(count(request, metric, note=partial(_show_note, status, label)))
            except ChildError as error:
                typer.echo(f"{label} failed: {error}", err=True)
                raise typer.Exit(SOME_FAILED) from error
    return maps


def _show_note(status: Status, label: str, text: str) -> None:
    status.update(f"{label}, {text}")


def _show(here: Here, maps: Sequence[Counts], metric: str, top: int | None, path: Path, as_json: bool) -> None:
    from renderer.pictures.counts import METRICS
    from renderer.pictures.heatmap import summarise
    from renderer.pictures.heatmap_picture import Panel, draw

    panels = [Panel(_title(request, here), counts) for request, counts in zip(here.requests, maps, strict=True)]
    try:
        drawn = draw(panels, path, _headline(here), f"{METRICS[metric]} per pixel", top)
    except OSError as error:
        raise OptionError(f"The picture {str(path)!r} cannot be written: {error.strerror}.") from error
    if as_json:
        print_json(_document(here, [asdict(summarise(counts)) for counts in maps], metric, drawn, path))
        return
    for panel in panels:
        typer.echo(f"{panel.title}: {summarise(panel.counts).text}")
    typer.echo(f"Drew {METRICS[metric]} per pixel to {path}")


def _document(here: Here, figures: Sequence[Json], metric: str, top: int, path: Path) -> Json:
    first = here.requests[0]
    return {
        "scene": first.scene,
        "triangles": len(here.scene.faces),
        "size": list(first.size),
        "rays_kind": first.rays,
        "metric": metric,
        "scale_max": top,
        "file": str(path),
        "maps": [
            {**request.variant.as_dict(), "per_pixel": figure}
            for request, figure in zip(here.requests, figures, strict=True)
        ],
    }


def _title(request: Request, here: Here) -> str:
    """The traversal, and whatever else the maps differ in."""
    mine = request.variant.as_dict()
    shared = _shared(here)
    return " ".join(value for axis, value in mine.items() if axis == "traversal" or axis not in shared)


def _shared(here: Here) -> dict[str, str]:
    """The axes on which all maps have one value."""
    variants = [request.variant.as_dict() for request in here.requests]
    return {axis: value for axis, value in variants[0].items() if all(other[axis] == value for other in variants)}


def _headline(here: Here) -> list[str]:
    scene, first, shared = here.scene, here.requests[0], _shared(here)
    note = f" ({scene.note})" if scene.note else ""
    width, height = first.size
    said = [f"{len(scene.faces):,} triangles", f"{width}x{height}", RAYS[first.rays]]
    said += [f"{axis} {shared[axis]}" for axis in ("method", "layout") if axis in shared]
    return [f"{scene.name}{note}", ", ".join(said)]
