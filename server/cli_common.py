"""What verbs share: options, printing, and speaking to a service."""

from __future__ import annotations

import json
from typing import Annotated, Any
from urllib.parse import urlsplit

import httpx
import typer
from rich.console import Console

from server.settings import settings

TIMEOUT_S = 60.0
PLAIN_WIDTH = 160
LOOPBACK = ("localhost", "127.0.0.1", "::1")

JsonFlag = Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")]
ServerOption = Annotated[str | None, typer.Option(help="The service's address (RAYFARM_SERVER).", show_default=False)]
ParentOption = Annotated[int | None, typer.Option(hidden=True, help="End with this process.")]


class ClientError(ValueError):
    """A service that does not answer, or refuses; the message is its sentence."""


def print_json(value: Any) -> None:
    """Print plain JSON on standard output."""
    print(json.dumps(value, indent=2, ensure_ascii=False))


def make_console() -> Console:
    """A console on standard output; without a terminal lines are not folded early."""
    console = Console(highlight=False)
    return console if console.is_terminal else Console(highlight=False, width=PLAIN_WIDTH)


class Client:
    """A service over HTTP."""

    def __init__(self, address: str | None = None) -> None:
        """Speak to `address`, by default the one in RAYFARM_SERVER."""
        self.address = (address or settings().server).rstrip("/")
        if urlsplit(self.address).scheme not in ("http", "https"):
            raise ClientError(f"{self.address!r} is no address: write it as http://127.0.0.1:8710.")
        remote = urlsplit(self.address).hostname not in LOOPBACK
        self._http = httpx.Client(base_url=self.address, timeout=TIMEOUT_S, trust_env=remote)

    def get(self, path: str, params: list[tuple[str, str]] | None = None) -> Any:
        """GET a path under /api/v1 as JSON."""
        return self._ask("GET", path, params=params).json()

    def get_text(self, path: str, params: list[tuple[str, str]] | None = None) -> str:
        """GET a path under /api/v1 as text."""
        return self._ask("GET", path, params=params).text

    def post(self, path: str, body: dict[str, Any]) -> Any:
        """POST a JSON body to a path under /api/v1."""
        return self._ask("POST", path, json=body).json()

    def close(self) -> None:
        """Close the connection."""
        self._http.close()

    def __enter__(self) -> Client:
        """Use as a context that closes."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()

    def _ask(self, method: str, path: str, **values: Any) -> httpx.Response:
        try:
            answer = self._http.request(method, f"/api/v1/{path}", **values)
        except httpx.TransportError as error:
            raise ClientError(
                f"No RayFarm service answers at {self.address}: start one with `rayfarm serve` or use --server."
            ) from error
        if answer.is_error:
            raise ClientError(_detail(answer))
        return answer


def _detail(answer: httpx.Response) -> str:
    try:
        return str(answer.json()["detail"])
    except (ValueError, KeyError, TypeError):
        return f"The service answered {answer.status_code} {answer.reason_phrase}."
