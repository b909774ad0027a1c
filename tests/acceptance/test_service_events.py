"""Progress over HTTP: streams that replay, go on, end, resume without loss or repetition, and stop with the server."""

from __future__ import annotations

import io
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import fastapi.routing
import pytest
from event_service import EventService, running_events, wait_until
from rich.console import Console

from server.cli import events as cli_events
from server.cli.common import Client, ClientError
from server.cli.events import Message, read_messages
from server.cli.follow import follow_study

HOSTILE = "<b>\r\nevent: end\n\ndata: {}\n\n\u2028\x85\x0bé 'x' \"y\""


@pytest.fixture
def service(database_url: str) -> Iterator[EventService]:
    with running_events(database_url) as running:
        yield running


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EventService]:
    """One for tests that the database does not matter to."""
    with running_events(f"sqlite:///{tmp_path_factory.mktemp('here') / 'x.sqlite'}") as running:
        yield running


@contextmanager
def streaming(service: EventService, path: str, last: str | None = None) -> Iterator[Iterator[Message]]:
    headers = {} if last is None else {"Last-Event-ID": last}
    with service.client() as client, client.stream("GET", path, headers=headers) as answer:
        assert answer.status_code == 200, answer.read()
        assert answer.headers["content-type"].startswith("text/event-stream")
        yield read_messages(answer.iter_lines())


def whole(service: EventService, path: str, last: str | None = None) -> list[Message]:
    with streaming(service, path, last) as messages:
        return list(messages)


def states(messages: list[Message]) -> list[tuple[int, str]]:
    return [(message.data["job"], message.data["state"]) for message in messages if message.name == "change"]


def test_a_jobs_stream_replays_goes_on_and_ends(service: EventService) -> None:
    (job,) = service.add()
    service.change(job, "preparing")
    with streaming(service, f"jobs/{job}/events") as messages:
        seen = [next(messages), next(messages)]
        service.change(job, "running", reason=HOSTILE)
        seen.append(next(messages))
        service.change(job, "judging", "done")
        seen += list(messages)
    assert states(seen) == [(job, state) for state in ("queued", "preparing", "running", "judging", "done")]
    assert [message.name for message in seen] == ["change"] * 5 + ["end"]
    assert seen[2].data["reason"] == HOSTILE
    assert seen[2].data["progress"] == {"done": 0, "ended": 0, "total": 2}
    assert seen[4].data["progress"] == {"done": 2, "ended": 0, "total": 2}
    assert seen[5].data == {"job": job, "study": None}
    assert (seen[5].id, seen[4].data["study_progress"]) == (None, None)


def test_a_studys_stream_ends_with_its_last_job(service: EventService) -> None:
    first, second = service.add(2, study=True)
    (other,) = service.add()
    with streaming(service, "studies/1/events") as messages:
        seen = [next(messages), next(messages)]
        service.change(first, "failed", reason="No.")
        service.change(other, "running", "done")
        seen.append(next(messages))
        assert seen[-1].data["study_progress"] == {"done": 0, "ended": 0, "total": 4}
        service.change(second, "done")
        seen += list(messages)
    assert states(seen) == [(first, "queued"), (second, "queued"), (first, "failed"), (second, "done")]
    assert seen[-1].name == "end"
    assert seen[-2].data["study_progress"] == {"done": 2, "ended": 0, "total": 4}


def test_a_stream_resumes_after_any_event(service: EventService) -> None:
    jobs = service.add(3, study=True)
    for state in ("preparing", "running", "waiting", "done"):
        for job in jobs:
            service.change(job, state)
    everything = whole(service, "studies/1/events")
    assert len(everything) == 16
    for number, message in enumerate(everything[:-1]):
        assert message.id is not None
        rest = whole(service, "studies/1/events?after=0", last=message.id)  # The header goes before.
        assert rest == everything[number + 1 :]
        assert whole(service, f"studies/1/events?after={message.id}") == rest


def test_all_events_start_now_or_where_asked(service: EventService) -> None:
    first, second = service.add(2)
    with streaming(service, "events") as news, streaming(service, "events?after=0") as everything:
        assert states([next(everything), next(everything)]) == [(first, "queued"), (second, "queued")]
        service.change(first, "done")
        service.change(second, "running")
        expected = [(first, "done"), (second, "running")]
        assert states([next(news), next(news)]) == states([next(everything), next(everything)]) == expected


@pytest.mark.parametrize(
    ("path", "last", "status", "word"),
    [
        ("jobs/99/events", None, 404, "no job 99"),
        ("jobs/x/events", None, 404, "no job x"),
        ("studies/7/events", None, 404, "no study 7"),
        ("events", "x", 422, "last-event-id"),
        ("events", "-1", 422, "last-event-id"),
        ("events?after=99999999999999999999", None, 422, "after"),
    ],
)
def test_a_bad_question_is_refused(here: EventService, path: str, last: str | None, status: int, word: str) -> None:
    with here.client() as client:
        answer = client.get(path, headers={} if last is None else {"Last-Event-ID": last})
    assert answer.status_code == status
    assert answer.headers["content-type"] == "application/problem+json"
    assert word in answer.json()["detail"]
    assert not here.feed.is_polling


def test_an_idle_stream_is_kept_alive(here: EventService, monkeypatch: pytest.MonkeyPatch) -> None:
    assert vars(fastapi.routing)["_PING_INTERVAL"] == 15
    monkeypatch.setattr("fastapi.routing._PING_INTERVAL", 0.1)
    with here.client() as client, client.stream("GET", "events") as answer:
        lines = answer.iter_lines()
        assert [next(lines), next(lines), next(lines)] == [": ping", "", ": ping"]


def test_clients_that_go_are_let_go(here: EventService) -> None:
    (job,) = here.add()
    with ExitStack() as stack:
        for _ in range(5):
            next(stack.enter_context(streaming(here, f"jobs/{job}/events")))
        assert here.feed.is_polling
    wait_until(lambda: not here.feed.is_polling)


def test_the_end_of_the_server_ends_its_streams(service: EventService, caplog: pytest.LogCaptureFixture) -> None:
    (job,) = service.add()
    with streaming(service, f"jobs/{job}/events") as messages, streaming(service, "events") as idle:
        assert next(messages).data["state"] == "queued"
        wait_until(lambda: service.feed._listeners == 2)
        service.stop()
        # A clean end, without an `end`: the client may come again. uvicorn had to cancel nothing.
        assert (list(messages), list(idle)) == ([], [])
    assert [record.message for record in caplog.records if record.name.startswith("uvicorn")] == []


def test_following_outlives_a_restart(service: EventService, monkeypatch: pytest.MonkeyPatch) -> None:
    """A study changes before, while and after the server is away: everything is told once."""
    monkeypatch.setattr(cli_events, "RETRY_S", 0.05)
    first, second, third = service.add(3, study=True)
    output, ended = io.StringIO(), []

    def follow() -> None:
        with Client(service.base) as client:
            ended.append(follow_study(client, 1, Console(file=output, width=200)))

    follower = threading.Thread(target=follow)
    follower.start()
    service.change(first, "running", "done")
    wait_until(lambda: "[1/3]" in output.getvalue())
    service.stop()
    service.change(second, "failed", reason=HOSTILE + "[bold]")
    service.start()
    service.change(third, "cancelled", reason="Cancelled on request.")
    follower.join()
    assert [study["state"] for study in ended] == ["done"]
    lines = output.getvalue()
    assert lines.startswith("[1/3] forest, ")
    assert [lines.count(word) for word in (": done", ": failed: ", ": cancelled: Cancelled on request.")] == [1, 1, 1]
    assert "[bold]" in lines


def test_a_service_that_stays_away_is_given_up(service: EventService, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cli_events, "RETRY_S", 0.01)
    monkeypatch.setattr(cli_events, "PATIENCE_S", 0.1)
    (job,) = service.add()
    with Client(service.base) as client:
        changes = cli_events.follow_events(client, f"jobs/{job}/events")
        assert next(changes)["state"] == "queued"
        service.stop()
        with pytest.raises(ClientError, match="No RayFarm service answers"):
            next(changes)


def test_a_refusal_is_not_tried_again(here: EventService) -> None:
    with Client(here.base) as client, pytest.raises(ClientError, match="There is no job 99"):
        next(cli_events.follow_events(client, "jobs/99/events"))


def test_lines_are_read_as_the_standard_says() -> None:
    def read(text: str) -> list[tuple[str, str | None, Any]]:
        return [(m.name, m.id, m.lines) for m in read_messages(text.split("\n"))]

    assert read(": ping\n\nevent: a\ndata:x\ndata:  y\nid: 3\n\n") == [("a", "3", ["x", " y"])]
    assert read("event: a\n\ndata\n\ndata: cut off") == [("message", None, [""])]
    assert read("retry: 5\nwhat: x\n\n") == []
