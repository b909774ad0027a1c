"""A real server on a free loopback port whose inside a test can look at, and changes written as workers write them."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import httpx

from renderer.request import Request
from renderer.variant import Variant
from server.live.feed import Feed
from server.service import Server, address, listen, make_server
from server.settings import Settings
from server.store.database import Database
from server.store.models import Job
from server.store.records import Order, add_jobs, add_study, change_state
from server.store.states import State


@dataclass
class EventService:
    """A service at one address, to be stopped and started, and its database."""

    url: str
    database: Database
    port: int = 0
    _serving: list[tuple[Server, threading.Thread, socket.socket]] = field(default_factory=list)

    @property
    def base(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def feed(self) -> Feed:
        feed = self._serving[-1][0].app.state.feed
        assert isinstance(feed, Feed)
        return feed

    def start(self) -> None:
        sock = listen("127.0.0.1", self.port)
        self.port = int(address(sock).rpartition(":")[2])
        server = make_server(Settings(database_url=self.url))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [sock]})
        thread.start()
        self._serving.append((server, thread, sock))
        wait_until(lambda: server.started)

    def stop(self) -> None:
        for server, thread, sock in self._serving:
            server.should_exit = True
            thread.join()
            sock.close()
        self._serving.clear()

    def client(self) -> httpx.Client:
        return httpx.Client(base_url=f"{self.base}/api/v1/", timeout=30, trust_env=False)

    def add(self, count: int = 1, study: bool = False) -> list[int]:
        """Jobs of two slices each, of one study or of none; their ids."""
        order = Order(Request("forest", Variant(), frames=2, rounds=2))
        with self.database.writing() as session:
            study_id = add_study(session, "x", {}, []).id if study else None
            slices = add_jobs(session, [order] * count, study_id=study_id)
            return list(dict.fromkeys(part.job_id for part in slices))

    def change(self, job_id: int, *states: State, reason: str | None = None) -> None:
        for state in states:
            with self.database.writing() as session:
                job = session.get_one(Job, job_id, with_for_update=True)
                for part in job.slices if state == "done" else ():
                    part.state = "done"
                change_state(session, job, state, reason)


@contextmanager
def running_events(url: str) -> Iterator[EventService]:
    """A running service on a database."""
    database = Database(url)
    service = EventService(url, database)
    service.start()
    try:
        yield service
    finally:
        service.stop()
        database.close()


def wait_until(condition: Callable[[], bool], seconds: float = 20.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, f"nothing happened in {seconds} s"
        time.sleep(0.02)
