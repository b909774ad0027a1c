"""Schemathesis over the OpenAPI document: no 5xx, nothing outside the schema, no job lost."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from datetime import timedelta
from typing import Any

import httpx
import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from service_fakes import Service, running_service
from sqlalchemy import func, select

from server.access import tokens
from server.store.database import Database
from server.store.models import Job, Slice, Study

SEED = 20_260_101
FEW, MANY = 8, 250
"""Requests for each operation and each kind of sender."""
JOB = {"scene": "cornell-box", "size": 16, "frames": 1}
STREAMS = "/events"


@pytest.fixture(scope="module")
def sender(
    tmp_path_factory: pytest.TempPathFactory,
    database_kind: str,
    fresh_database: Callable[[str], AbstractContextManager[str]],
) -> Iterator[tuple[Service, str]]:
    """A service that asks for tokens, and an admin's."""
    with fresh_database(database_kind) as url:
        database = Database(url)
        with database.writing() as session:
            text = tokens.create(session, "fuzzer", ["admin"], timedelta(days=1))[1]
        database.close()
        folder = tmp_path_factory.mktemp("service")
        with running_service(folder, url, require_tokens=True, submissions_per_minute=0) as service:
            yield service, text


def test_few_requests_of_every_kind(sender: tuple[Service, str]) -> None:
    assert fuzz(*sender, FEW) > 2 * FEW


@pytest.mark.long
def test_ten_thousand_requests(sender: tuple[Service, str]) -> None:
    assert fuzz(*sender, MANY) >= 10_000


def fuzz(service: Service, text: str, examples: int) -> int:
    """Send requests to every operation, with and without the token; how many were sent."""
    headers = {"authorization": f"Bearer {text}"}
    base = str(service.client.base_url)
    raw = service.client.get("/api/v1/openapi.json", headers=headers).json()
    schema = schemathesis.openapi.from_dict(raw)
    schema.config.update(base_url=base)
    sent = created = 0
    for result in schema.get_all_operations():
        operation: Any = result.ok()  # type: ignore[union-attr]
        if operation.path.endswith(STREAMS) and operation.method.upper() == "GET":
            continue  # A stream without an end is no response to validate.
        # Few bodies that are made up name a scene: one that does goes between.
        assert service.client.post("/api/v1/jobs", json=JOB, headers=headers).status_code == 201
        created += 1
        for headers_sent in (headers, {}):
            codes = fuzz_operation(operation, headers_sent, examples)
            sent += len(codes)
            if (operation.method.upper(), operation.path) == ("POST", "/api/v1/jobs"):
                created += codes.count(201)
    check_none_lost(service, created, headers)
    return sent


def fuzz_operation(operation: Any, headers: dict[str, str], examples: int) -> list[int]:
    """Send requests to one operation; the status codes of the answers."""
    codes: list[int] = []

    @seed(SEED)
    @settings(
        max_examples=examples,
        database=None,
        deadline=None,
        phases=(Phase.generate,),
        suppress_health_check=list(HealthCheck),
    )
    @given(data=st.data())
    def run(data: Any) -> None:
        case = data.draw(operation.as_strategy())
        response = case.call(headers=headers)
        codes.append(response.status_code)
        assert response.status_code < 500, (case.as_curl_command(), response.text)
        assert headers or response.status_code in (400, 401), (case.as_curl_command(), response.text)
        operation.validate_response(response)

    run()
    return codes


def check_none_lost(service: Service, created: int, headers: dict[str, str]) -> None:
    """Every job that was taken is there with its slices, and each of its studies answers."""
    with service.database.reading() as session:
        alone = session.scalar(select(func.count()).where(Job.study_id.is_(None)))
        bare = session.scalar(
            select(func.count(Job.id)).where(~select(Slice.id).where(Slice.job_id == Job.id).exists())
        )
        studies = session.scalars(select(Study.id)).all()
    assert (alone, bare) == (created, 0)
    for number in studies[:20]:
        answer: httpx.Response = service.client.get(f"/api/v1/studies/{number}", headers=headers)
        assert answer.status_code == 200
