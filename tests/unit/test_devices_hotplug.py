"""Following adb: every change is told, and no adb server, dead, dying or absent, ends it."""

from __future__ import annotations

import logging
import queue
from collections.abc import Iterator
from typing import Any

import pytest
from adbutils import AdbError, DeviceEvent

from server.devices.hotplug import States, Watcher

PATIENCE_S = (0.001, 0.01)


class FakeAdb:
    """An adb server whose states and end the test decides."""

    def __init__(self) -> None:
        self.now: States | Exception = {}
        self._events: queue.Queue[Any] = queue.Queue()

    def states(self) -> States:
        if isinstance(self.now, Exception):
            raise self.now
        return dict(self.now)

    def changes(self) -> Iterator[Any]:
        while True:
            event = self._events.get()
            if isinstance(event, Exception):
                raise event
            yield event

    def cut(self) -> None:
        self.end()

    def set(self, states: States, *events: DeviceEvent) -> None:
        self.now = states
        for event in events:
            self._events.put(event)

    def end(self) -> None:
        self._events.put(AdbError("connection closed"))


class Heard:
    def __init__(self) -> None:
        self._told: queue.Queue[tuple[States | None, set[str]]] = queue.Queue()

    def __call__(self, states: States | None, gone: set[str]) -> None:
        self._told.put((states, gone))

    def next(self) -> tuple[States | None, set[str]]:
        return self._told.get(timeout=10)

    def until(self, states: States | None) -> set[str]:
        while True:
            told, gone = self.next()
            if told == states:
                return gone


@pytest.fixture
def adb() -> FakeAdb:
    return FakeAdb()


@pytest.fixture
def heard(adb: FakeAdb) -> Iterator[Heard]:
    told = Heard()
    watcher = Watcher(adb, told, PATIENCE_S)
    watcher.start()
    yield told
    watcher.stop(10.0)


def test_every_change_is_told_with_what_was_away_in_between(adb: FakeAdb, heard: Heard) -> None:
    assert heard.next() == ({}, set())
    adb.set({"p": "connecting"}, DeviceEvent(True, "p", "connecting"))
    assert heard.next() == ({"p": "connecting"}, set())
    # adbutils tells a change of state as a leaving and a coming.
    adb.set({"p": "device"}, DeviceEvent(False, "p", "absent"), DeviceEvent(True, "p", "device"))
    assert heard.next() == ({"p": "device"}, set())
    assert heard.next() == ({"p": "device"}, set())
    adb.set({"p": "device"}, DeviceEvent(False, "p", "absent"))
    assert heard.next() == ({"p": "device"}, {"p"})


def test_a_server_that_was_restarted_is_followed_again(adb: FakeAdb, heard: Heard) -> None:
    heard.until({})
    adb.set({"p": "device"})
    adb.end()
    assert heard.until({"p": "device"}) == {"p"}, "it may have been away"


def test_no_server_is_said_once_and_looked_for_on(adb: FakeAdb, heard: Heard, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "rayfarm.devices"):
        heard.until({})
        adb.now = AdbError("No adb exe could be found\x1b[2J")
        adb.end()
        for _ in range(3):
            heard.until(None)
        adb.now = {"p": "device"}
        heard.until({"p": "device"})
    [record] = caplog.records
    assert "No adb server can be had" in record.getMessage()
    assert "\x1b" not in record.getMessage()


def test_a_watcher_that_never_began_can_be_stopped(adb: FakeAdb) -> None:
    Watcher(adb, Heard(), PATIENCE_S).stop(1.0)
