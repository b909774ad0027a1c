"""Who is silent, timed by a clock that does not jump: clocks that are set, watchers that stop, databases that go."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest

from server.queue.watch import Watch

LEASE_S = 60.0
NOON = datetime(2026, 1, 1, 12, tzinfo=UTC)


class Clock:
    time_s = 100.0

    def __call__(self) -> float:
        return self.time_s


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def watch(clock: Clock) -> Watch:
    return Watch(LEASE_S, clock)


def look_for(watch: Watch, clock: Clock, seconds: int, at: datetime = NOON) -> list[str]:
    silent: list[str] = []
    for _ in range(0, seconds, 2):
        clock.time_s += 2
        silent = watch.silent([("w", at)])
    return silent


def test_a_worker_is_silent_after_a_lease_and_no_sooner(watch: Watch, clock: Clock) -> None:
    assert watch.silent([("w", NOON)]) == []
    assert look_for(watch, clock, 58) == []
    assert look_for(watch, clock, 2) == ["w"]


@pytest.mark.parametrize("jump", [timedelta(days=400), timedelta(days=-400)])
def test_a_clock_that_is_set_kills_nobody_and_spares_nobody(watch: Watch, clock: Clock, jump: timedelta) -> None:
    """The worker's clock, or the watcher's: the time in the row decides nothing, its change does."""
    beat = NOON
    for _ in range(100):
        beat += timedelta(seconds=2)
        assert look_for(watch, clock, 2, beat) == []
    assert look_for(watch, clock, 58, beat + jump) == []
    assert look_for(watch, clock, 4, beat + jump) == ["w"]


def test_what_nobody_could_see_is_no_silence(watch: Watch, clock: Clock) -> None:
    watch.silent([("w", NOON)])
    clock.time_s += 10 * LEASE_S  # The watcher was stopped, or the database was away.
    assert watch.silent([("w", NOON)]) == []
    assert look_for(watch, clock, 44) == []
    assert look_for(watch, clock, 2) == ["w"]


def test_who_is_gone_from_the_table_is_forgotten(watch: Watch, clock: Clock) -> None:
    look_for(watch, clock, 40)
    assert watch.silent([]) == []
    assert look_for(watch, clock, 40) == []


def test_while_writing_fails_nobody_is_silent(watch: Watch, clock: Clock) -> None:
    """A full disk lets rows be read, and no sign of life be given."""
    watch.silent([("w", NOON)])
    for _ in range(20):
        assert look_for(watch, clock, 10) == []
        watch.forget()
    assert look_for(watch, clock, 60) == []
    assert look_for(watch, clock, 2) == ["w"]
