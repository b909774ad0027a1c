"""`Idempotency-Key`: a submission that is sent twice is taken once."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from datetime import timedelta
from typing import Any

import httpx
import pytest
from event_service import EventService, running_events
from sqlalchemy import func, select, update

from server.api.idempotency import forget_submissions
from server.cli import common as cli_common
from server.cli.common import Client, ClientError
from server.store.models import Job, Study, Submitted

JOB = {"scene": "forest", "frames": 1}
STUDY = {"name": "x", "scenes": "forest", "axes": {"traversal": "bvh-stack,kd-backtrack"}, "frames": 1}
PATHS: dict[str, dict[str, Any]] = {"jobs": JOB, "studies": STUDY}


@pytest.fixture
def service(database_url: str) -> Iterator[EventService]:
    with running_events(database_url) as running:
        yield running


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EventService]:
    """One for tests that the database does not matter to."""
    with running_events(f"sqlite:///{tmp_path_factory.mktemp('here') / 'x.sqlite'}") as running:
        yield running


def post(service: EventService, path: str, body: Any, key: str | None) -> httpx.Response:
    headers = {} if key is None else {"Idempotency-Key": key}
    with service.client() as client:
        return client.post(path, json=body, headers=headers)


def count(service: EventService, table: Any) -> int:
    with service.database.reading() as session:
        return session.scalar(select(func.count()).select_from(table)) or 0


@pytest.mark.parametrize("path", PATHS)
def test_the_same_again_gets_the_same_answer(service: EventService, path: str) -> None:
    first = post(service, path, PATHS[path], "k-1")
    assert first.status_code == 201, first.text
    assert "idempotent-replayed" not in first.headers
    service.change(first.json().get("jobs", [first.json()])[0]["id"], "cancelled")
    jobs = count(service, Job)
    again = post(service, path, PATHS[path], "k-1")
    assert again.headers["idempotent-replayed"] == "true"
    assert (again.status_code, again.content) == (201, first.content)
    assert again.headers["location"] == first.headers["location"] == f"/api/v1/{path}/1"
    assert (count(service, Job), count(service, Submitted)) == (jobs, 1)
    assert post(service, path, PATHS[path], "k-2").json()["id"] == 2
    assert post(service, path, PATHS[path], None).json()["id"] == 3
    assert count(service, Submitted) == 2


@pytest.mark.parametrize(("path", "body"), [("jobs", JOB | {"frames": 2}), ("studies", STUDY)])
def test_a_key_belongs_to_one_request(service: EventService, path: str, body: Any) -> None:
    assert post(service, "jobs", JOB, "mine").status_code == 201
    refused = post(service, path, body, "mine")
    assert refused.status_code == 422
    assert refused.headers["content-type"] == "application/problem+json"
    assert "'mine' was used with another request" in refused.json()["detail"]
    assert (count(service, Job), count(service, Study)) == (1, 0)


@pytest.mark.parametrize("path", PATHS)
def test_several_at_once_create_one(service: EventService, path: str) -> None:
    together, answers = threading.Barrier(8), []

    def send() -> None:
        together.wait()
        answers.append(post(service, path, PATHS[path], "at-once"))

    threads = [threading.Thread(target=send) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [answer.status_code for answer in answers] == [201] * 8
    assert len({answer.content for answer in answers}) == 1
    assert sum("idempotent-replayed" not in answer.headers for answer in answers) == 1
    assert count(service, Job) == {"jobs": 1, "studies": 2}[path]
    assert count(service, Study) == {"jobs": 0, "studies": 1}[path]


def test_a_key_is_kept_for_a_day(service: EventService) -> None:
    for key in ("old", "other"):
        post(service, "jobs", JOB, key)
    age(service, "old", hours=23.9)
    assert post(service, "jobs", JOB, "old").json()["id"] == 1
    age(service, "old", hours=0.2)
    assert post(service, "jobs", JOB | {"frames": 2}, "old").json()["id"] == 3
    age(service, "other", hours=25)
    post(service, "jobs", JOB, "new")
    with service.database.writing() as session:
        forget_submissions(session)  # As the server does every hour.
        assert set(session.scalars(select(Submitted.key))) == {"old", "new"}


def test_what_was_refused_is_not_kept(service: EventService) -> None:
    assert post(service, "jobs", JOB | {"scene": "atlantis"}, "k").status_code == 422
    assert post(service, "jobs", {"scene": "forest", "device": "nobody"}, "k").status_code == 422
    assert count(service, Submitted) == 0
    assert post(service, "jobs", JOB, "k").status_code == 201


@pytest.mark.parametrize(
    "headers",
    [
        [("Idempotency-Key", "")],
        [("Idempotency-Key", "two words")],
        [("Idempotency-Key", "x" * 201)],
        [("Idempotency-Key", b"\xc3\xa9")],
        [("Idempotency-Key", "a"), ("Idempotency-Key", "b")],
    ],
    ids=["empty", "two words", "too long", "not ASCII", "two"],
)
def test_a_bad_key_is_refused(here: EventService, headers: list[tuple[Any, Any]]) -> None:
    with here.client() as client:
        answer = client.post("jobs", json=JOB, headers=headers)
    assert answer.status_code == 422
    assert "send one of 1 to 200 visible ASCII characters" in answer.json()["detail"]
    assert count(here, Job) == 0


def test_a_long_key_is_fine(service: EventService) -> None:
    key = "!~" * 100
    assert [post(service, "jobs", JOB, key).json()["id"] for _ in range(2)] == [1, 1]


def test_a_lost_answer_is_asked_for_again(service: EventService, monkeypatch: pytest.MonkeyPatch) -> None:
    """The service takes the study, but its first two answers do not arrive."""
    monkeypatch.setattr(cli_common, "PAUSES_S", (0.0, 0.0))
    lost: list[httpx.Response] = []
    send = httpx.HTTPTransport.handle_request

    def lose_two(transport: httpx.HTTPTransport, request: httpx.Request) -> httpx.Response:
        answer = send(transport, request)
        if len(lost) < 2:
            answer.read()
            lost.append(answer)
            raise httpx.ReadError("lost")
        return answer

    monkeypatch.setattr(httpx.HTTPTransport, "handle_request", lose_two)
    with Client(service.base) as client:
        study = client.submit("studies", STUDY)
    assert study["id"] == 1
    assert count(service, Study) == 1


def test_tries_end(here: EventService, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cli_common, "PAUSES_S", (0.0, 0.0))
    tries: list[int] = []

    def fail(error: type[httpx.TransportError]) -> None:
        def lose(_: httpx.HTTPTransport, request: httpx.Request) -> httpx.Response:
            tries.append(1)
            raise error("lost", request=request)

        monkeypatch.setattr(httpx.HTTPTransport, "handle_request", lose)

    with Client(here.base) as client:
        for error, expected in ((httpx.ReadError, 3), (httpx.ConnectError, 1)):
            fail(error)
            with pytest.raises(ClientError, match="No RayFarm service answers"):
                client.submit("studies", STUDY)
            assert len(tries) == expected
            tries.clear()


def age(service: EventService, key: str, hours: float) -> None:
    with service.database.writing() as session:
        stored = session.get_one(Submitted, key)
        older = stored.created_at - timedelta(hours=hours)
        session.execute(update(Submitted).where(Submitted.key == key).values(created_at=older))
