"""Streams of events end with the token that opened them, and say so."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from browsing import running_browser, until
from service_fakes import Service, running_service
from sqlalchemy import update

from server.access import stays, tokens
from server.access.stays import ENDED
from server.cli.common import Client, ClientError
from server.cli.events import Message, follow_events, read_messages
from server.live import feed
from server.settings import settings
from server.store.database import Database
from server.store.models import Token, now

JOB = {"scene": "cornell-box", "size": 16, "frames": 1}
SOON_S = 10.0


@pytest.fixture(scope="module")
def admin() -> list[str]:
    """The text of a token that may do everything, filled by `service`."""
    return []


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory, admin: list[str]) -> Iterator[Service]:
    folder = tmp_path_factory.mktemp("service")
    database = Database(f"sqlite:///{folder / 'service.sqlite'}")
    with database.writing() as session:
        admin.append(tokens.create(session, "of a test", ["admin"], timedelta(days=1))[1])
    database.close()
    with running_service(folder, require_tokens=True) as running:
        running.client.headers["authorization"] = f"Bearer {admin[0]}"
        yield running


@pytest.fixture(autouse=True)
def _soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stays, "CHECK_S", 0.1)
    monkeypatch.setattr(feed, "QUIET_S", 0.1)
    monkeypatch.setattr("fastapi.routing._PING_INTERVAL", 2 * SOON_S)  # A silent stream fails by its client's timeout.


def rest(messages: Iterator[Message]) -> list[Message]:
    """The messages until the stream ends, which it must do soon."""
    deadline, seen = time.monotonic() + SOON_S, []
    for message in messages:
        seen.append(message)
        assert time.monotonic() < deadline, "the stream goes on"
    return seen


def make(service: Service) -> str:
    with service.database.writing() as session:
        return tokens.create(session, "made by a test", ["read"], timedelta(hours=1))[1]


def end(service: Service, text: str, how: str) -> None:
    key = text.partition(".")[0]
    with service.database.writing() as session:
        if how == "revoked":
            tokens.revoke(session, key)
        else:
            session.execute(update(Token).where(Token.id == key).values(expires_at=now() - timedelta(seconds=1)))


@pytest.mark.parametrize("how", ["revoked", "expired"])
@pytest.mark.parametrize("credential", ["token", "session"])
def test_a_stream_ends_with_its_token(service: Service, how: str, credential: str) -> None:
    text = make(service)
    headers = {"authorization": f"Bearer {text}"}
    if credential == "session":
        session = tokens.begin_session(service.database, text)
        headers = {"authorization": "", "cookie": f"rayfarm_session={session}"}
    job = service.post("jobs", **JOB)["id"]
    with service.client.stream("GET", f"/api/v1/jobs/{job}/events", headers=headers, timeout=SOON_S) as answer:
        assert answer.status_code == 200
        messages = read_messages(answer.iter_lines())
        assert next(messages).data["state"] == "queued"
        end(service, text, how)
        assert rest(messages) == [Message("refused", None, [f'{{"detail": "{ENDED}"}}'])]
    assert service.client.get("/api/v1/jobs", headers=headers).status_code == 401


@pytest.mark.parametrize("path", ["events?after=0", "jobs/{}/events"])
def test_a_stream_of_a_busy_farm_ends_with_its_token_too(service: Service, path: str) -> None:
    text = make(service)
    path = path.format(service.post("jobs", **JOB)["id"])
    stop = threading.Event()

    def submit() -> None:
        while not stop.wait(0.02):
            service.post("jobs", **JOB)

    busy = threading.Thread(target=submit)
    headers = {"authorization": f"Bearer {text}"}
    with service.client.stream("GET", f"/api/v1/{path}", headers=headers, timeout=SOON_S) as answer:
        busy.start()
        try:
            messages = read_messages(answer.iter_lines())
            assert next(messages).name == "change"
            end(service, text, "revoked")
            assert rest(messages)[-1].name == "refused"
        finally:
            stop.set()
            busy.join()


def test_a_stream_goes_on_while_its_token_is_good(service: Service) -> None:
    job = service.post("jobs", **JOB)["id"]
    headers = {"authorization": f"Bearer {make(service)}"}
    with service.client.stream("GET", f"/api/v1/jobs/{job}/events", headers=headers, timeout=SOON_S) as answer:
        messages = read_messages(answer.iter_lines())
        assert next(messages).data["state"] == "queued"
        stop = threading.Event()
        stop.wait(1)  # ten looks at the token
        service.client.post(f"/api/v1/jobs/{job}/cancel").raise_for_status()
        assert [message.name for message in rest(messages)] == ["change", "end"]


def test_who_follows_is_told(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    text = make(service)
    monkeypatch.setenv("RAYFARM_TOKEN", text)
    settings.cache_clear()
    job = service.post("jobs", **JOB)["id"]
    with Client(str(service.client.base_url)) as client:
        client._http.timeout = SOON_S
        changes = follow_events(client, f"jobs/{job}/events")
        assert next(changes)["state"] == "queued"
        end(service, text, "revoked")
        with pytest.raises(ClientError, match="expired or was revoked"):
            next(changes)
    settings.cache_clear()


def test_an_open_page_leads_to_the_login(service: Service, tmp_path: Path) -> None:
    text = make(service)
    session = tokens.begin_session(service.database, text)
    job = service.post("jobs", **JOB)["id"]
    base = str(service.client.base_url).rstrip("/")
    with running_browser(tmp_path) as chrome:
        chrome.get(f"{base}/login")
        cookie: dict[str, Any] = {"name": "rayfarm_session", "value": session, "httpOnly": True}
        chrome.add_cookie(cookie)
        chrome.get(f"{base}/jobs/{job}")
        assert chrome.current_url == f"{base}/jobs/{job}"
        end(service, text, "revoked")
        until(chrome, lambda: chrome.current_url == f"{base}/login?next=%2Fjobs%2F{job}")
