"""Following a service's events until they end, over lost connections and restarts."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from server.cli.common import Client, ClientError

RETRY_S = 1.0
PATIENCE_S = 60.0
"""How long a service may be away before it is given up."""

Json = dict[str, Any]


@dataclass
class Message:
    """One event as it was sent; its lines of data are to be joined."""

    name: str = "message"
    id: str | None = None
    lines: list[str] = field(default_factory=list)

    @property
    def data(self) -> Json:
        """Its data, which is JSON."""
        data: Json = json.loads("\n".join(self.lines))
        return data


def follow_events(client: Client, path: str) -> Iterator[Json]:
    """Each change that a path under /api/v1 tells, once, until its end.

    Raise ClientError when the service refuses, or was away for `PATIENCE_S` seconds.
    """
    import httpx

    last: str | None = None
    lost_at: float | None = None
    while True:
        try:
            with client.stream(path, {} if last is None else {"Last-Event-ID": last}) as lines:
                lost_at = None
                for message in read_messages(lines):
                    last = message.id or last
                    if message.name == "end":
                        return
                    if message.name == "refused":
                        raise ClientError(message.data["detail"])
                    yield message.data
        except httpx.TransportError as error:
            lost_at = lost_at or time.monotonic()
            if time.monotonic() > lost_at + PATIENCE_S:
                raise client.no_answer() from error
        time.sleep(RETRY_S)


def read_messages(lines: Iterable[str]) -> Iterator[Message]:
    """The events in a stream's lines (HTML Standard, 9.2.6); one that the stream's end cuts off is left out."""
    message = Message()
    for line in lines:
        name, _, value = line.partition(":")
        value = value.removeprefix(" ")
        if not line:
            if message.lines:
                yield message
            message = Message()
        elif name == "event":
            message.name = value
        elif name == "id":
            message.id = value
        elif name == "data":
            message.lines.append(value)
