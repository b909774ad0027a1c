"""What foretells speed, as the page and the API tell it of stored results."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from service_fakes import Service, document, running_service

from renderer.request import Request
from renderer.variant import Variant
from server.store.records import Order, add_jobs, add_result

HOSTILE = "<i>phone</i> & co"
COSTS = {"sah": 40.0, "binned": 45.0, "median": 90.0, "sbvh": 30.0}


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    with running_service(tmp_path_factory.mktemp("service")) as running:
        for builder, cost in COSTS.items():
            request = Request("cornell-box", Variant(builder=builder), frames=4, rounds=1)
            found = document(request, cost, HOSTILE)
            found["sah"] = {**found["sah"], "cost": cost, "epo": 100.0 / cost}
            found |= {"mrays_per_s": 100.0 / cost, "mrays_per_cpu_s": None}
            with running.database.writing() as session:
                part = add_jobs(session, [Order(request, HOSTILE)])[0]
                part.job.state = "done"
                add_result(session, part.job, found)
        yield running


def test_the_page_names_the_best_predictor_first(service: Service) -> None:
    answer = service.client.get("/predictors", params={"scene": "cornell-box"})
    assert answer.status_code == 200
    assert "<i>phone</i>" not in answer.text
    assert "&lt;i&gt;phone&lt;/i&gt; &amp; co, primary and shadow rays" in answer.text
    rows = answer.text.split("<tbody>")[1].split("</tbody>")[0]
    assert rows.index("SAH cost") < rows.index("100 %")
    assert "Of results with scene cornell-box." in answer.text
    assert answer.text.count("<circle") >= len(COSTS)


def test_the_api_gives_the_same(service: Service) -> None:
    (device,) = service.client.get("/api/v1/predictors").json()["devices"]
    assert (device["device"], device["rays"]) == (HOSTILE, "both")
    cost = next(one for one in device["predictors"] if one["key"] == "sah")
    assert (cost["results"], cost["variants"]) == (len(COSTS), 1)
    assert cost["explained"] == pytest.approx(1.0)
    assert cost["exponent"] == pytest.approx(1.0)


def test_nothing_to_tell_is_said(service: Service) -> None:
    answer = service.client.get("/predictors", params={"scene": "forest"})
    assert "Nothing to tell yet" in answer.text
    assert service.client.get("/predictors", params={"scne": "x"}).status_code == 422


def test_the_comparison_leads_there(service: Service) -> None:
    assert 'href="/predictors?' in service.client.get("/").text
