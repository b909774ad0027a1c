"""`rayfarm compare --format`: a comparison's results or its table, written as they come."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO
from urllib.parse import urlsplit

from server.cli.common import LOOPBACK, ClientError, authorization

if TYPE_CHECKING:
    import httpx

FORMATS = ("csv", "jsonl", "parquet", "markdown", "latex")
PATIENCE_S = 60.0
"""How long nothing may come."""


def export(address: str, params: list[tuple[str, str]], form: str, output: Path | None) -> None:
    """Write the service's answer to a file, or to standard output; raise ClientError. A file is whole or not there."""
    import httpx

    if form not in FORMATS:
        raise ClientError(f"Unknown format {form!r}: choose one of {', '.join(FORMATS)}.")
    if output is None and form == "parquet" and sys.stdout.isatty():
        raise ClientError("Parquet is no text for a terminal: name a file with --output.")
    remote = urlsplit(address).hostname not in LOOPBACK
    query = httpx.QueryParams([*params, ("format", form)])
    try:
        with (
            httpx.Client(base_url=address, timeout=PATIENCE_S, trust_env=remote, headers=authorization()) as client,
            client.stream("GET", "/api/v1/compare", params=query) as answer,
        ):
            if answer.is_error:
                answer.read()
                raise ClientError(_sentence(answer))
            with _writing(output) as file:
                for piece in answer.iter_bytes():
                    file.write(piece)
    except httpx.ConnectError as error:
        raise ClientError(
            f"No RayFarm service answers at {address}: start one with `rayfarm serve` or use --server."
        ) from error
    except httpx.TransportError as error:
        raise ClientError(f"The service at {address} stopped answering: ask again.") from error


@contextmanager
def _writing(output: Path | None) -> Iterator[BinaryIO]:
    if output is None:
        sys.stdout.flush()
        yield sys.stdout.buffer
        sys.stdout.buffer.flush()
        return
    part = output.with_name(f"{output.name}.part")
    try:
        with part.open("wb") as file:
            yield file
        part.replace(output)
    except OSError as error:
        raise ClientError(f"The file {output} cannot be written: {error.strerror or error}.") from error
    finally:
        part.unlink(missing_ok=True)


def _sentence(answer: httpx.Response) -> str:
    try:
        return str(answer.json()["detail"])
    except (ValueError, KeyError, TypeError):
        return f"The service answered {answer.status_code} {answer.reason_phrase}."
