"""Tokens, sessions and scopes on a real server; the names of these tests stand in docs/security.md."""

from __future__ import annotations

import json
import logging
import re
import socket
from collections.abc import Iterator
from datetime import timedelta
from typing import Any
from unittest.mock import Mock

import httpx
import pytest
from browsing import running_browser, until
from fastapi import FastAPI
from fastapi.routing import APIRoute
from prometheus_client.parser import text_string_to_metric_families
from pydantic import SecretStr
from selenium.webdriver.common.by import By
from service_fakes import Service, running_service
from sqlalchemy import select, update
from typer.testing import CliRunner

from server.access import tokens
from server.access.limits import Limit
from server.access.scopes import SAFE, SCOPES, WRITES, is_public, needed
from server.app import create_app
from server.cli.app import app as cli
from server.cli.common import Client, ClientError
from server.service import ServiceError, listen, running
from server.settings import Settings, settings
from server.store.database import Database
from server.store.models import Job, Token, now

JOB = {"scene": "cornell-box", "size": 16, "frames": 1}
PER_MINUTE = 40


@pytest.fixture(scope="module")
def texts() -> dict[str, str]:
    """A token's text for each scope, filled by `service`."""
    return {}


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory, texts: dict[str, str]) -> Iterator[Service]:
    folder = tmp_path_factory.mktemp("service")
    database = Database(f"sqlite:///{folder / 'service.sqlite'}")
    with database.writing() as session:
        for scope in SCOPES:
            texts[scope] = tokens.create(session, f"for {scope}", [scope], timedelta(days=1))[1]
    database.close()
    with running_service(folder, require_tokens=True, submissions_per_minute=PER_MINUTE) as running:
        yield running


def bearer(text: str) -> dict[str, str]:
    return {"authorization": f"Bearer {text}"}


def make(service: Service, *scopes: str, valid: timedelta = timedelta(hours=1)) -> str:
    with service.database.writing() as session:
        return tokens.create(session, "made by a test", scopes, valid)[1]


def count_jobs(service: Service) -> int:
    with service.database.reading() as session:
        return len(session.scalars(select(Job.id)).all())


def own_origin(service: Service) -> dict[str, str]:
    return {"origin": str(service.client.base_url).rstrip("/")}


def log_in(service: Service, text: str, there: str = "/") -> httpx.Response:
    """The answer to the form of /login; its session is in its cookie alone."""
    form = {"token": text, "next": there}
    answer = service.client.post("/login", data=form, headers=own_origin(service))
    service.client.cookies.clear()
    return answer


def routes(app: FastAPI) -> list[tuple[str, str]]:
    found = []
    for route in app.routes:
        included = getattr(getattr(route, "original_router", None), "routes", [route])
        found += [(method, one.path) for one in included if isinstance(one, APIRoute) for method in one.methods or ()]
    return found


def test_every_route_that_writes_states_its_scope(tmp_path: Any) -> None:
    app = create_app(Settings(database_url=f"sqlite:///{tmp_path / 'x.sqlite'}"))
    found = routes(app)
    assert len(found) > 40
    writes = {(method, path) for method, path in found if method not in SAFE and not is_public(path)}
    assert writes == set(WRITES)
    public = {path for _, path in found if is_public(path)}
    assert public == {"/livez", "/readyz", "/login", "/logout"}
    assert needed("POST", "/api/v1/something/new") == needed("PATCH", "/api/v1/jobs") == "admin"


def test_without_a_token_nothing_is_shown_or_taken(service: Service) -> None:
    for path in (
        "/api/v1/jobs",
        "/api/v1/openapi.json",
        "/api/v1/events",
        "/",
        "/jobs/1",
        "/nothing",
        "/plotly.min.js",
    ):
        answer = service.client.get(path)
        assert answer.status_code == 401, path
        assert answer.headers["www-authenticate"] == "Bearer"
        assert answer.headers["content-type"] == "application/problem+json"
        assert "content-security-policy" in answer.headers
    before = count_jobs(service)
    assert service.client.post("/api/v1/jobs", json=JOB).status_code == 401
    assert count_jobs(service) == before
    assert service.client.get("/livez").status_code == service.client.get("/readyz").status_code == 200


@pytest.mark.parametrize("change", ["secret", "id", "shape", "empty", "session word"])
def test_a_wrong_token_is_refused(service: Service, texts: dict[str, str], change: str) -> None:
    key, _, secret = texts["read"].partition(".")
    wrong = {
        "secret": f"{key}.{secret[:-1]}{'A' if secret[-1] != 'A' else 'B'}",
        "id": f"{'0' * 12}.{secret}",
        "shape": texts["read"] + "x",
        "empty": ".",
        "session word": "' OR 1=1 --",
    }[change]
    answer = service.client.get("/api/v1/jobs", headers=bearer(wrong))
    assert answer.status_code == 401
    assert secret not in answer.text


def test_an_expired_token_is_refused(service: Service) -> None:
    text = make(service, "read")
    assert service.client.get("/api/v1/jobs", headers=bearer(text)).status_code == 200
    with service.database.writing() as session:
        key = text.partition(".")[0]
        session.execute(update(Token).where(Token.id == key).values(expires_at=now() - timedelta(seconds=1)))
    assert service.client.get("/api/v1/jobs", headers=bearer(text)).status_code == 401
    assert log_in(service, text).status_code == 403


@pytest.mark.parametrize(
    ("method", "path", "allowed"),
    [
        ("GET", "/api/v1/jobs", SCOPES),
        ("POST", "/api/v1/studies/plan", SCOPES),
        ("POST", "/api/v1/jobs", ("submit", "admin")),
        ("POST", "/api/v1/jobs/1/cancel", ("submit", "admin")),
        ("POST", "/api/v1/jobs/1/profiles", ("submit", "admin")),
        ("POST", "/api/v1/devices/x/clear", ("worker", "admin")),
        ("DELETE", "/api/v1/devices/x", ("admin",)),
        ("PUT", "/api/v1/nothing", ("admin",)),
    ],
)
def test_a_wrong_scope_is_refused(
    service: Service, texts: dict[str, str], method: str, path: str, allowed: tuple[str, ...]
) -> None:
    for scope in SCOPES:
        answer = service.client.request(method, path, headers=bearer(texts[scope]))
        assert (answer.status_code not in (401, 403)) == (scope in allowed), (scope, answer.text)


def test_a_revoked_token_ends_its_sessions(service: Service) -> None:
    text = make(service, "read")
    cookie = log_in(service, text).headers["set-cookie"].partition(";")[0]
    assert service.client.get("/studies", headers={"cookie": cookie}).status_code == 200
    with service.database.writing() as session:
        tokens.revoke(session, text.partition(".")[0])
    assert service.client.get("/studies", headers={"cookie": cookie}).status_code == 401
    assert service.client.get("/api/v1/jobs", headers=bearer(text)).status_code == 401


def test_only_hashes_are_stored(service: Service) -> None:
    text = make(service, "submit")
    session = log_in(service, text).headers["set-cookie"].partition(";")[0].partition("=")[2]
    service.database.close()
    files = [path.read_bytes() for path in service.folder.glob("service.sqlite*")]
    assert any(text.partition(".")[0].encode() in content for content in files)
    for secret in (text.partition(".")[2], session.partition(".")[2]):
        assert not any(secret.encode() in content for content in files)


def test_a_session_is_a_cookie_that_scripts_cannot_read(service: Service, texts: dict[str, str]) -> None:
    answer = log_in(service, texts["submit"], "/studies?x=1")
    assert (answer.status_code, answer.headers["location"]) == (303, "/studies?x=1")
    cookie = answer.headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "samesite=lax" in cookie.lower()
    assert texts["submit"].partition(".")[2] not in cookie
    secure = {**own_origin(service), "x-forwarded-proto": "https"}
    assert (
        "Secure" in service.client.post("/login", data={"token": texts["read"]}, headers=secure).headers["set-cookie"]
    )
    service.client.cookies.clear()
    pair = cookie.partition(";")[0]
    out = service.client.post("/logout", headers={**own_origin(service), "cookie": pair})
    assert out.status_code == 303
    assert service.client.get("/studies", headers={"cookie": pair}).status_code == 401
    assert service.client.get("/api/v1/jobs", headers=bearer(pair.partition("=")[2])).status_code == 401


@pytest.mark.parametrize(
    "origin", [{}, {"origin": "null"}, {"origin": "http://evil.example"}, {"origin": "http://127.0.0.1:1"}]
)
def test_another_site_cannot_write_with_a_session(
    service: Service, texts: dict[str, str], origin: dict[str, str]
) -> None:
    cookie = log_in(service, texts["submit"]).headers["set-cookie"].partition(";")[0]
    before = count_jobs(service)
    for kind in ("application/json", "text/plain", "application/x-www-form-urlencoded"):
        headers = {"cookie": cookie, "content-type": kind, **origin}
        answer = service.client.post("/api/v1/jobs", content=json.dumps(JOB), headers=headers)
        assert answer.status_code == 403
    assert service.client.post("/login", data={"token": texts["read"]}, headers=origin).status_code == 403
    assert service.client.post("/logout", headers={"cookie": cookie, **origin}).status_code == 403
    assert count_jobs(service) == before
    own = {"cookie": cookie, **own_origin(service)}
    forged = service.client.post("/api/v1/jobs", json=JOB, headers={**own, "sec-fetch-site": "cross-site"})
    assert forged.status_code == 403
    assert service.client.post("/api/v1/jobs", json=JOB, headers=own).status_code == 201


@pytest.mark.parametrize(
    "there", ["//evil.example", "https://evil.example", "/\\evil.example", "javascript:x", "\t//e.x"]
)
def test_a_login_leads_to_no_other_site(service: Service, texts: dict[str, str], there: str) -> None:
    assert log_in(service, texts["read"], there).headers["location"] == "/"


def test_a_page_leads_to_the_login_and_back(
    service: Service, texts: dict[str, str], tmp_path_factory: pytest.TempPathFactory
) -> None:
    with running_browser(tmp_path_factory.mktemp("browser")) as chrome:
        base = str(service.client.base_url).rstrip("/")
        chrome.get(f"{base}/devices?x=1")
        assert chrome.current_url == f"{base}/login?next=%2Fdevices%3Fx%3D1"
        chrome.find_element(By.NAME, "token").send_keys("no token")
        chrome.find_element(By.CSS_SELECTOR, "main button").click()
        until(chrome, lambda: "unknown" in chrome.page_source)
        chrome.find_element(By.NAME, "token").send_keys(texts["worker"])
        chrome.find_element(By.CSS_SELECTOR, "main button").click()
        until(chrome, lambda: chrome.current_url == f"{base}/devices?x=1")
        assert chrome.execute_script("return document.cookie") == ""
        chrome.save_screenshot(str(service.folder / "devices.png"))
        chrome.find_element(By.XPATH, "//button[.='Log out']").click()
        until(chrome, lambda: chrome.current_url == f"{base}/login")
        chrome.get(f"{base}/devices")
        assert "/login" in chrome.current_url


def test_idempotency_keys_are_each_tokens_own(service: Service) -> None:
    first, second = make(service, "submit"), make(service, "submit")
    made = [
        service.client.post("/api/v1/jobs", json=JOB, headers={**bearer(text), "idempotency-key": "same"}).json()["id"]
        for text in (first, second, first)
    ]
    assert made[0] == made[2] != made[1]


def test_too_many_submissions_are_refused(service: Service) -> None:
    text = make(service, "submit")
    codes = []
    for _ in range(PER_MINUTE + 5):
        answer = service.client.post("/api/v1/jobs", json={}, headers=bearer(text))
        codes.append(answer.status_code)
    assert codes[0] == 422
    assert codes[-1] == 429
    assert int(answer.headers["retry-after"]) >= 1
    assert service.client.post("/api/v1/jobs", json={}, headers=bearer(make(service, "submit"))).status_code == 422


def test_a_limit_lets_the_rate_through_and_no_more() -> None:
    at = [0.0]
    limit = Limit(60, lambda: at[0])
    passed = 0
    for step in range(6000):
        at[0] = step / 50
        passed += limit.wait_s("a") == 0.0
    assert 60 + 118 <= passed <= 60 + 120
    assert limit.wait_s("b") == 0.0
    assert all(Limit(0).wait_s("a") == 0.0 for _ in range(1000))


def test_bodies_are_capped_while_they_stream(service: Service, texts: dict[str, str]) -> None:
    def pieces() -> Iterator[bytes]:
        yield b'{"scene": "'
        for _ in range(40):
            yield b"x" * 65536

    headers = {**bearer(texts["admin"]), "content-type": "application/json"}
    for path in ("jobs", "studies", "studies/plan", "devices"):
        assert service.client.post(f"/api/v1/{path}", content=pieces(), headers=headers).status_code == 413


@pytest.mark.parametrize("host", ["0.0.0.0", "::"])
def test_other_than_loopback_addresses_need_tokens(tmp_path: Any, host: str) -> None:
    bound = Mock(spec=socket.socket, getsockname=lambda: (host, 1))  # No test listens there.
    url = f"sqlite:///{tmp_path / 'x.sqlite'}"
    with (
        pytest.raises(ServiceError, match="rayfarm tokens create"),
        running(Settings(database_url=url), bound, False),
    ):
        pass
    with (
        pytest.raises(ServiceError, match="rayfarm tokens create"),
        running(Settings(database_url=url, require_tokens=True), listen("127.0.0.1", 0), False),
    ):
        pass


def test_the_verbs_make_list_and_revoke_tokens(
    service: Service, monkeypatch: pytest.MonkeyPatch, tmp_path: Any
) -> None:
    monkeypatch.setenv("RAYFARM_DATABASE_URL", service.database_url)
    settings.cache_clear()
    runner = CliRunner()
    made = json.loads(runner.invoke(cli, ["tokens", "create", "<b>lab</b>", "--scope", "read", "--json"]).stdout)
    assert made["scopes"] == ["read"]
    base = str(service.client.base_url)
    monkeypatch.setenv("RAYFARM_TOKEN", made["token"])
    settings.cache_clear()
    with Client(base) as client:
        assert "jobs" in client.get("jobs")
        with pytest.raises(ClientError, match="scope submit"):
            client.submit("jobs", JOB)
    monkeypatch.delenv("RAYFARM_TOKEN")
    file = tmp_path / "token"
    file.write_text(made["token"] + "\n")
    monkeypatch.setenv("RAYFARM_TOKEN_FILE", str(file))
    file.chmod(0o644)
    settings.cache_clear()
    with pytest.raises(ClientError, match="chmod 600"):
        Client(base)
    file.chmod(0o600)
    with Client(base) as client:
        assert "jobs" in client.get("jobs")
        assert runner.invoke(cli, ["tokens", "revoke", made["id"]]).exit_code == 0
        with pytest.raises(ClientError, match="revoked"):
            client.get("jobs")
    listed = json.loads(runner.invoke(cli, ["tokens", "list", "--json"]).stdout)["tokens"]
    assert {one["id"]: one["state"] for one in listed}[made["id"]] == "revoked"
    assert made["token"].partition(".")[2] not in json.dumps(listed)
    monkeypatch.undo()
    settings.cache_clear()


def test_secrets_are_in_no_log(
    service: Service, texts: dict[str, str], caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
) -> None:
    caplog.set_level(logging.DEBUG)
    session = log_in(service, texts["admin"]).headers["set-cookie"]
    service.client.get("/api/v1/jobs", headers=bearer(texts["admin"]))
    service.client.post("/api/v1/jobs", content=b"{", headers=bearer(texts["admin"]))
    said = "".join(record.getMessage() for record in caplog.records if record.name.startswith(("rayfarm", "uvicorn")))
    said += "".join(capfd.readouterr())
    for secret in (texts["admin"].partition(".")[2], re.split("[.;]", session)[1]):
        assert secret not in said
    assert texts["admin"] not in repr(Settings(token=SecretStr(texts["admin"])))


def test_no_path_of_a_user_is_opened(service: Service, texts: dict[str, str]) -> None:
    headers = bearer(texts["admin"])
    climb = ("..%2f..%2fapp.py", "%2e%2e/%2e%2e/app.py", "%2fetc%2fpasswd", "....//app.py", "..%5capp.py", "a%00b")
    bases = ("/static/", "/scenes/", "/api/v1/pictures/", "/api/v1/jobs/", "/api/v1/jobs/1/profiles/", "/jobs/")
    for base in bases:
        for path in climb:
            answer = service.client.get(base + path, headers=headers)
            assert answer.status_code in (400, 404, 422), (base, path, answer.status_code)
            assert "create_app" not in answer.text
            assert "root:" not in answer.text
    for scene in ("/etc/passwd", "../../app.py", "file:///etc/passwd", "forest:../1"):
        assert service.client.post("/api/v1/jobs", json={**JOB, "scene": scene}, headers=headers).status_code == 422


def test_metrics_are_prometheus_text_without_job_ids(service: Service, texts: dict[str, str]) -> None:
    service.client.post("/api/v1/jobs", json=JOB, headers=bearer(texts["admin"]))
    answer = service.client.get("/metrics", headers=bearer(texts["read"]))
    assert answer.headers["content-type"].startswith("text/plain")
    families = {family.name: family for family in text_string_to_metric_families(answer.text)}
    queued = next(sample for sample in families["rayfarm_jobs"].samples if sample.labels == {"state": "queued"})
    assert queued.value == count_jobs(service)
    assert families["process_resident_memory_bytes"].samples[0].value > 1e6
    assert {label for family in families.values() for s in family.samples for label in s.labels} <= {
        "state",
        "kind",
        "device",
    }
