"""Running the service: a listening socket, uvicorn, and a worker beside it."""

from __future__ import annotations

import logging
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from ipaddress import ip_address

import uvicorn
from fastapi import FastAPI

from server import processes
from server.access import tokens
from server.app import create_app
from server.logs import facts
from server.settings import Settings
from server.store.database import Database

log = logging.getLogger("rayfarm.server")

RESTART_S = 2.0


class ServiceError(ValueError):
    """A service that cannot start; the message is one sentence that says what to do."""


def listen(host: str, port: int) -> socket.socket:
    """A listening socket; port 0 takes a free one."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    sock = socket.socket(family, socket.SOCK_STREAM)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        sock.bind((host.strip("[]"), port))
        sock.listen(128)
    except OSError as error:
        sock.close()
        reason = (error.strerror or str(error)).lower()
        raise ServiceError(f"Cannot listen at {host}:{port} ({reason}): choose another --port.") from error
    return sock


def address(sock: socket.socket) -> str:
    """The service's address on a listening socket."""
    host, port = sock.getsockname()[:2]
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


class Server(uvicorn.Server):
    """A server that ends its streams of events when it is to end; uvicorn would wait for them."""

    def __init__(self, config: uvicorn.Config, app: FastAPI) -> None:
        super().__init__(config)
        self.app = app

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """End the streams, then everything else."""
        self.app.state.feed.end()
        await super().shutdown(sockets)


def make_server(settings: Settings) -> Server:
    """A server of the application, to be run on a socket from `listen`."""
    app = create_app(settings)
    # Its loggers stay as they are: what they say goes where everything goes (`server.logs`).
    config = uvicorn.Config(
        app, log_config=None, log_level="warning", access_log=False, server_header=False, timeout_graceful_shutdown=3
    )
    return Server(config, app)


@contextmanager
def running(settings: Settings, sock: socket.socket, with_worker: bool, quiet: bool = False) -> Iterator[None]:
    """The service on `sock`, with a worker beside it where asked for, `quiet` or not; both end with the block.

    Raise DatabaseError when the database cannot be opened, ServiceError when the server does not start.
    """
    settings = _for_socket(settings, sock)
    database = Database(settings.database_url)
    try:
        _require_tokens(settings, database, sock)
    finally:
        database.close()
    server = make_server(settings)
    serving = threading.Thread(target=server.run, kwargs={"sockets": [sock]}, name="server")
    keeper = WorkerKeeper(quiet) if with_worker else None
    serving.start()
    try:
        _wait_until_started(server, serving)
        if keeper is not None:
            keeper.start()
        log.info("serving", extra=facts(address=address(sock)))
        yield
    finally:
        log.info("ending")
        if keeper is not None:
            keeper.stop()
        server.should_exit = True
        serving.join()
        sock.close()


def _for_socket(settings: Settings, sock: socket.socket) -> Settings:
    """The settings for what listens at a socket: anywhere but at a loopback address they ask for tokens."""
    bound = ip_address(sock.getsockname()[0])
    if bound.is_loopback:
        return settings
    name = f"[{bound}]" if bound.version == 6 else str(bound)
    hosts = settings.allowed_hosts if bound.is_unspecified else (*settings.allowed_hosts, name)
    return settings.model_copy(update={"require_tokens": True, "allowed_hosts": hosts})


def _require_tokens(settings: Settings, database: Database, sock: socket.socket) -> None:
    if settings.require_tokens and not tokens.any_live(database):
        sock.close()
        raise ServiceError(
            "This address needs tokens and there are none: make one with `rayfarm tokens create NAME --scope admin`."
        )


def _wait_until_started(server: uvicorn.Server, serving: threading.Thread) -> None:
    while not server.started:
        if not serving.is_alive():
            raise ServiceError("The server did not start: its log says why.")
        time.sleep(0.02)


class WorkerKeeper:
    """Keeps one worker process running, and starts another when it ends."""

    def __init__(self, quiet: bool = False) -> None:
        self._words = ["worker", *(["--quiet"] if quiet else [])]
        self._stop = threading.Event()
        # The worker ends with the thread that started it (PR_SET_PDEATHSIG), so this thread lives as long as it.
        self._thread = threading.Thread(target=self._run, name="worker-keeper")

    def start(self) -> None:
        """Start the worker."""
        self._thread.start()

    def stop(self) -> None:
        """End the worker, if it was started, and wait for it."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        while not self._stop.is_set():
            child = processes.start_verb(*self._words)
            while child.poll() is None and not self._stop.wait(0.2):
                pass
            if self._stop.is_set():
                processes.stop(child)
                return
            log.warning("the worker ended with code %d: another is started", child.returncode)
            self._stop.wait(RESTART_S)
