"""`rayfarm devices`: what there is to measure on, and attaching more."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Annotated, Any
from urllib.parse import quote

import typer
from rich.table import Table
from rich.text import Text

from server.cli.common import Client, JsonFlag, ServerOption, make_console, print_json
from server.device_words import describe_gpu, describe_running, describe_state

FAILED = 1
PERIOD_S = 0.3

Json = dict[str, Any]

DeviceArgument = Annotated[str, typer.Argument(help="A device as `rayfarm devices` lists it.")]
AddressArgument = Annotated[
    str, typer.Argument(metavar="HOST:PORT", help="As the phone's Wireless debugging shows it.")
]
HostOption = Annotated[
    str | None, typer.Option("--host", help="The worker's host that is to reach the phone.", show_default=False)
]
WaitOption = Annotated[float, typer.Option("--wait", min=0, help="Seconds to wait for the phone.")]

verbs = typer.Typer(
    help="List the devices, or attach and care for one.", invoke_without_command=True, rich_markup_mode=None
)


def register(app: typer.Typer) -> None:
    """Add the verbs."""
    app.add_typer(verbs, name="devices")


@verbs.callback()
def show(context: typer.Context, server: ServerOption = None, as_json: JsonFlag = False) -> None:
    """List the devices: whether jobs may run on them, what they are, what runs."""
    if context.invoked_subcommand is None:
        with Client(server) as client:
            found = client.get("devices")
        print_json(found) if as_json else _print_table(found["devices"])


@verbs.command()
def attach(
    address: AddressArgument,
    host: HostOption = None,
    wait: WaitOption = 60.0,
    server: ServerOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Connect to a network phone, now and whenever it is lost; the exit code is 1 when it did not come."""
    with Client(server) as client:
        device = client.post("devices", {"address": address, "host": host})
        # One that has no worker to connect to it has its advice at once.
        if device["advice"] is None:
            device = _follow(client, device, wait, lambda now: now["presence"] != "connecting")
    if as_json:
        print_json(device)
    elif device["presence"] == "online":
        typer.echo(f"{device['id']} is attached; `rayfarm devices` shows when it has been checked.")
    else:
        typer.echo(f"{device['id']} is {device['presence']}. {device['advice'] or 'It is still being connected to.'}")
    if device["presence"] != "online":
        raise typer.Exit(FAILED)


@verbs.command()
def pair(
    address: AddressArgument,
    code: Annotated[str, typer.Argument(help="The six digits beside it.")],
    host: HostOption = None,
    wait: WaitOption = 60.0,
    server: ServerOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Pair with a phone that shows a pairing code; the exit code is 1 when it did not pair."""
    with Client(server) as client:
        asked = client.post("devices/pair", {"address": address, "code": code, "host": host})
        pairing = _follow(client, asked, wait, lambda now: now["presence"] != "connecting")
    if as_json:
        print_json(pairing)
    else:
        typer.echo(pairing["advice"] or "The phone has not answered yet.")
    if pairing["presence"] != "online":
        raise typer.Exit(FAILED)


@verbs.command()
def clear(device: DeviceArgument, server: ServerOption = None, as_json: JsonFlag = False) -> None:
    """Put a device that was set aside back to work."""
    with Client(server) as client:
        cleared = client.post(f"{_path(device)}/clear", {})
    print_json(cleared) if as_json else typer.echo(f"{device} is {describe_state(cleared)}.")


@verbs.command()
def forget(device: DeviceArgument, server: ServerOption = None, as_json: JsonFlag = False) -> None:
    """Disconnect a device and remove it from the list; its results stay."""
    with Client(server) as client:
        client.delete(_path(device))
    print_json({"forgotten": device}) if as_json else typer.echo(f"{device} is forgotten.")


def _path(device_id: str) -> str:
    return f"devices/{quote(device_id, safe=':@')}"


def _follow(client: Client, device: Json, wait_s: float, done: Callable[[Json], bool]) -> Json:
    """A device once `done` with it, or after `wait_s` seconds as it is then."""
    until = time.monotonic() + wait_s
    while not done(device) and time.monotonic() < until:
        time.sleep(PERIOD_S)
        device = client.get(_path(device["id"]))
    return device


def _print_table(devices: list[Json]) -> None:
    console = make_console()
    if not devices:
        console.print("No device yet: start `rayfarm worker`, plug a phone in, or `rayfarm devices attach HOST:PORT`.")
        return
    table = Table(box=None, pad_edge=False)
    for head in ("device", "state", "what", "GPU and driver", "host", "now", "note"):
        table.add_column(head, no_wrap=head in ("device", "state"))
    for device in devices:
        cells = (device["id"], describe_state(device), device["name"], describe_gpu(device), device["host"])
        notes = (describe_running(device), device["set_aside"] or device["advice"])
        table.add_row(*(Text(cell or "") for cell in (*cells, *notes)))
    console.print(table)
