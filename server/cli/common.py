"""What verbs share: options, printing, and speaking to a service."""

from __future__ import annotations

import json
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import urlsplit

import typer
from rich.console import Console

if TYPE_CHECKING:
    import httpx

TIMEOUT_S = 60.0
UPLOAD_S = 900.0
"""How long a service may take to read a file after it was sent."""
UNAVAILABLE = 503
PAUSES_S = (0.5, 1.0, 2.0, 4.0)
"""Between the tries of a submission whose connection is lost."""
PLAIN_WIDTH = 160
LOOPBACK = ("localhost", "127.0.0.1", "::1")
SOME_FAILED = 1
"""The exit code when some of what was asked for has no result."""

JsonFlag = Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")]
ServerOption = Annotated[str | None, typer.Option(help="The service's address (RAYFARM_SERVER).", show_default=False)]
ParentOption = Annotated[int | None, typer.Option(hidden=True, help="End with this process.")]


class ClientError(ValueError):
    """A service that does not answer, or refuses; the message is its sentence."""


def print_json(value: Any) -> None:
    """Print plain JSON on standard output, at once: a verb that goes on is read through a pipe, too."""
    print(json.dumps(value, indent=2, ensure_ascii=False), flush=True)


def make_console() -> Console:
    """A console on standard output; without a terminal lines are not folded early."""
    console = Console(highlight=False)
    return console if console.is_terminal else Console(highlight=False, width=PLAIN_WIDTH)


class Client:
    """A service over HTTP."""

    def __init__(self, address: str | None = None) -> None:
        """Speak to `address`, by default the one in RAYFARM_SERVER."""
        import httpx

        self.address = (address or _usual_address()).rstrip("/")
        if urlsplit(self.address).scheme not in ("http", "https"):
            raise ClientError(f"{self.address!r} is no address: write it as http://127.0.0.1:8710.")
        remote = urlsplit(self.address).hostname not in LOOPBACK
        self._http = httpx.Client(base_url=self.address, timeout=TIMEOUT_S, trust_env=remote, headers=authorization())

    def get(self, path: str, params: list[tuple[str, str]] | None = None) -> Any:
        """GET a path under /api/v1 as JSON."""
        return self._ask("GET", path, params=params).json()

    def post(self, path: str, body: dict[str, Any]) -> Any:
        """POST a JSON body to a path under /api/v1."""
        return self._ask("POST", path, json=body).json()

    def upload(self, path: str, params: list[tuple[str, str]], file: Path) -> Any:
        """POST a file, piece by piece, to a path under /api/v1."""
        import httpx

        try:
            with file.open("rb") as content:
                answer = self._ask("POST", path, params=params, content=content, timeout=UPLOAD_S)
        except OSError as error:
            raise ClientError(f"The file {file} cannot be read: {error.strerror or error}.") from error
        except ClientError as error:
            if isinstance(error.__cause__, httpx.WriteError | httpx.RemoteProtocolError):
                raise ClientError("The service stopped reading the file: it may be too large for it.") from error
            raise
        return answer.json()

    def get_bytes(self, path: str) -> bytes:
        """GET a file from a path under /api/v1."""
        return self._ask("GET", path).content

    def delete(self, path: str) -> None:
        """DELETE a path under /api/v1."""
        self._ask("DELETE", path)

    def submit(self, path: str, body: dict[str, Any]) -> Any:
        """POST a JSON body to a path under /api/v1; it is taken once, even when it is sent again."""
        headers = {"Idempotency-Key": uuid.uuid4().hex}
        return self._ask("POST", path, PAUSES_S, json=body, headers=headers).json()

    @contextmanager
    def stream(self, path: str, headers: dict[str, str]) -> Iterator[Iterator[str]]:
        """GET a path under /api/v1 as lines, while they come; raise httpx.TransportError when they stop coming."""
        with self._http.stream("GET", f"/api/v1/{path}", headers=headers) as answer:
            if answer.is_error:
                answer.read()
                raise ClientError(_detail(answer))
            yield answer.iter_lines()

    def no_answer(self) -> ClientError:
        """The error of a service that is not there."""
        return ClientError(
            f"No RayFarm service answers at {self.address}: start one with `rayfarm serve` or use --server."
        )

    def close(self) -> None:
        """Close the connection."""
        self._http.close()

    def __enter__(self) -> Client:
        """Use as a context that closes."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()

    def _ask(self, method: str, path: str, pauses: tuple[float, ...] = (), **values: Any) -> httpx.Response:
        import httpx

        try:
            answer = self._send(method, path, pauses, **values)
        except httpx.TransportError as error:
            raise self.no_answer() from error
        if answer.is_error:
            raise ClientError(_detail(answer))
        return answer

    def _send(self, method: str, path: str, pauses: tuple[float, ...], **values: Any) -> httpx.Response:
        """Send, and again after each of the pauses while the connection is lost or the service's database is away.

        Not where nobody listens at first.
        """
        import httpx

        for number, pause_s in enumerate(pauses):
            try:
                answer = self._http.request(method, f"/api/v1/{path}", **values)
            except httpx.TransportError as error:
                if number == 0 and isinstance(error, httpx.ConnectError):
                    raise
            else:
                if answer.status_code != UNAVAILABLE:
                    return answer
            time.sleep(pause_s)
        return self._http.request(method, f"/api/v1/{path}", **values)


def authorization() -> dict[str, str]:
    """The header with the token of RAYFARM_TOKEN, or of the file RAYFARM_TOKEN_FILE; empty where there is none."""
    from server.settings import settings

    chosen = settings()
    text = chosen.token.get_secret_value() if chosen.token else _read_token(chosen.token_file)
    if not text.isascii() or not text.isprintable():
        raise ClientError("The token has characters that no token has: copy it once more.")
    return {"Authorization": f"Bearer {text}"} if text else {}


def _read_token(file: Path | None) -> str:
    if file is None:
        return ""
    try:
        if file.stat().st_mode & 0o077:
            raise ClientError(f"Others can read the token in {file}: chmod 600 {file}.")
        return file.read_text().strip()
    except (OSError, UnicodeDecodeError) as error:
        raise ClientError(f"The token file {file} cannot be read: correct RAYFARM_TOKEN_FILE.") from error


def _usual_address() -> str:
    from server.settings import settings

    return settings().server


def _detail(answer: httpx.Response) -> str:
    try:
        return str(answer.json()["detail"])
    except (ValueError, KeyError, TypeError):
        return f"The service answered {answer.status_code} {answer.reason_phrase}."
