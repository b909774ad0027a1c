"""Devices over the API, the command line and the page, without any: rows as a tracker writes them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path
from typing import Any
from urllib.parse import quote

import httpx
import pytest
from service_fakes import Service, running_service
from sqlalchemy import select, update

from server.cli import app as cli
from server.devices import registry, wanted
from server.devices.presence import note_states
from server.queue.lives import worker_id
from server.store.models import Device, Job, Slice, Worker, now

HOSTILE = "<img src=x onerror=alert(1)> [red]x[/] \"'&"
PHONE = "192.168.1.20:5555"


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    with running_service(tmp_path) as running:
        yield running


@pytest.fixture
def staffed(service: Service) -> Service:
    """A service with a live worker on the host `lab`."""
    add_worker(service, "lab")
    return service


def add_worker(service: Service, host: str) -> str:
    worker = worker_id(host)
    with service.database.writing() as session:
        session.add(Worker(id=worker, host=host))
    return worker


def add_phone(service: Service, device_id: str = PHONE, **values: Any) -> None:
    usual = {"kind": "phone", "host": "lab", "presence": "online", "facts": {"name": "Phone"}}
    with service.database.writing() as session:
        session.add(Device(id=device_id, **usual | {"health": {"passed": True}, "health_at": now()} | values))


def ask(service: Service, path: str, body: dict[str, Any]) -> httpx.Response:
    return service.client.post(f"/api/v1/devices{path}", json=body)


def rayfarm(service: Service, capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    code = cli.run(["devices", *words, "--server", str(service.client.base_url)])
    out, err = capsys.readouterr()
    return code, out, err


def test_attaching_is_asked_once_and_shown(staffed: Service) -> None:
    for _ in range(2):
        answer = ask(staffed, "", {"address": "192.168.1.20:05555"})
        assert answer.status_code == 202, answer.text
        assert answer.headers["location"] == f"/api/v1/devices/{PHONE}"
        view = answer.json()
        assert (view["id"], view["host"], view["presence"], view["advice"]) == (PHONE, "lab", "connecting", None)
        assert (view["ready"], view["facts"], view["health"]) == (False, {}, None)
    [listed] = staffed.get("devices")["devices"]
    assert listed == staffed.get(f"devices/{PHONE}")


def test_attaching_without_a_worker_says_what_is_missing(service: Service) -> None:
    view = ask(service, "", {"address": PHONE}).json()
    assert view["host"] is None
    assert "start `rayfarm worker`" in view["advice"].lower()


BAD: dict[str, tuple[str, dict[str, Any], int, str]] = {
    "no address": ("", {}, 422, "address is missing"),
    "a shell's words": ("", {"address": "h;reboot:5555"}, 422, "write HOST:PORT"),
    "no port": ("", {"address": "phone"}, 422, "write HOST:PORT"),
    "a number": ("", {"address": 5555}, 422, "address"),
    "an unknown host": ("", {"address": PHONE, "host": "nowhere"}, 422, "No worker ever ran on 'nowhere'"),
    "an unknown field": ("", {"address": PHONE, "adress": "x"}, 422, "adress"),
    "pairing without a code": ("/pair", {"address": PHONE}, 422, "code is missing"),
    "a code that is none": ("/pair", {"address": PHONE, "code": "98765x"}, 422, "six digits"),
    "a long code": ("/pair", {"address": PHONE, "code": "98765" * 50}, 422, "code"),
    "pairing from an unknown host": ("/pair", {"address": PHONE, "code": "987654", "host": "x"}, 422, "one of lab"),
    "clearing what is not there": ("/nothing/clear", {}, 404, "no device 'nothing'"),
}


@pytest.fixture(scope="module")
def idle(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """A service with a worker on `lab`, shared by what must leave no trace."""
    with running_service(tmp_path_factory.mktemp("idle")) as running:
        add_worker(running, "lab")
        yield running


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_one_sentence(idle: Service, name: str) -> None:
    path, body, status, words = BAD[name]
    answer = ask(idle, path, body)
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    detail = answer.json()["detail"]
    assert words in detail
    assert "\n" not in detail
    assert "98765" not in answer.text
    assert idle.get("devices") == {"devices": [], "pairings": []}


def test_pairing_waits_for_its_host_and_hides_the_code(staffed: Service) -> None:
    answer = ask(staffed, "/pair", {"address": PHONE, "code": "987654"})
    assert answer.status_code == 202, answer.text
    assert "987654" not in answer.text
    with staffed.database.writing() as session:
        assert wanted.take_pairings(session, "lab") == [(f"pair@{PHONE}", PHONE, "987654")]
        wanted.answer_pairing(session, f"pair@{PHONE}", False, "The phone did not pair.")
    view = staffed.get("devices")
    assert view["devices"] == []
    assert view["pairings"][0]["advice"] == "The phone did not pair."
    assert staffed.get(f"devices/pair@{PHONE}")["presence"] == "offline"


def test_pairing_without_a_worker_is_refused(service: Service) -> None:
    answer = ask(service, "/pair", {"address": PHONE, "code": "987654"})
    assert answer.status_code == 409
    with service.database.reading() as session:
        assert session.scalars(select(Device)).all() == []


@pytest.mark.parametrize("device_id", [PHONE, "llvmpipe@lab", "[fe80::1]:5555", "adb-X.y._adb-tls-connect._tcp", "a%b"])
def test_ids_of_every_shape_are_reached(staffed: Service, device_id: str) -> None:
    add_phone(staffed, device_id, set_aside="3 false hits.", health={"passed": False}, presence="offline")
    address = staffed.get("devices")["devices"][0]["url"]
    assert address == f"/api/v1/devices/{quote(device_id, safe=':@')}"
    assert staffed.client.get(address).json()["id"] == device_id
    assert staffed.client.post(f"{address}/clear").json()["set_aside"] is None
    assert staffed.client.delete(address).status_code == 204
    assert staffed.client.get(address).status_code == 404


def test_a_device_set_aside_is_not_ready_until_cleared(staffed: Service) -> None:
    add_phone(staffed, set_aside="3 false hits.", health={"passed": False, "reason": "3 false hits."})
    assert not staffed.get(f"devices/{PHONE}")["ready"]
    for _ in range(2):
        view = ask(staffed, f"/{PHONE}/clear", {}).json()
        assert (view["ready"], view["set_aside"]) == (True, None)
    assert view["health"] == {"passed": False, "reason": "3 false hits.", "cleared": True}


def test_what_is_in_use_is_not_forgotten(staffed: Service) -> None:
    add_phone(staffed, "usb")
    with staffed.database.writing() as session:
        session.add(Job(scene="forest", label="x", request={}, device="usb"))
    refused = staffed.client.delete("/api/v1/devices/usb")
    assert refused.status_code == 409
    assert "1 job is still open on usb" in refused.json()["detail"]
    with staffed.database.writing() as session:
        session.get_one(Job, 1).state = "done"
    assert "unplug it first" in staffed.client.delete("/api/v1/devices/usb").json()["detail"]
    with staffed.database.writing() as session:
        note_states(session, "lab", {})
    assert staffed.client.delete("/api/v1/devices/usb").status_code == 204


def test_what_runs_is_shown_by_device(staffed: Service) -> None:
    add_phone(staffed)
    worker = add_worker(staffed, "attic")
    with staffed.database.writing() as session:
        registry.see_twin(session, "attic")
        for device, holder in ((PHONE, worker), ("llvmpipe", worker), (PHONE, None)):
            job = Job(scene="forest", label="bvh-stack", request={}, device=device)
            job.slices = [Slice(round=0, state="running" if holder else "queued", worker=holder)]
            session.add(job)
    views = {view["id"]: view for view in staffed.get("devices")["devices"]}
    assert [part["job"] for part in views[PHONE]["running"]] == [1]
    assert [part["job"] for part in views["llvmpipe@attic"]["running"]] == [2]
    assert views[PHONE]["open_jobs"] == 2
    page = staffed.client.get("/devices").text
    assert 'href="/jobs/1"' in page
    assert "1 waiting" in page


def test_hostile_words_are_inert_on_the_page_and_in_the_terminal(
    staffed: Service, capsys: pytest.CaptureFixture[str]
) -> None:
    facts = {"name": HOSTILE, "soc": HOSTILE, "gl": {"renderer": HOSTILE, "version": HOSTILE}, "android": HOSTILE}
    add_phone(staffed, facts=facts, set_aside=HOSTILE, advice=HOSTILE, presence="offline")
    page = staffed.client.get("/devices").text
    assert "<img" not in page
    assert page.count("&lt;img src=x onerror=alert(1)&gt;") >= 5
    code, out, _ = rayfarm(staffed, capsys)
    assert code == 0
    assert "[red]x[/]" in " ".join(out.split())


def test_the_list_in_the_terminal_and_as_json(staffed: Service, capsys: pytest.CaptureFixture[str]) -> None:
    assert "No device yet" in rayfarm(staffed, capsys)[1]
    add_phone(staffed)
    add_phone(staffed, "usb", presence="unauthorized", advice="Tap Allow.", health=None)
    _, out, _ = rayfarm(staffed, capsys)
    assert "ready" in next(line for line in out.splitlines() if line.startswith(PHONE))
    assert "Tap Allow." in next(line for line in out.splitlines() if line.startswith("usb"))
    _, out, _ = rayfarm(staffed, capsys, "--json")
    assert json.loads(out) == staffed.get("devices")


def test_attach_tells_what_to_tap(staffed: Service, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = rayfarm(staffed, capsys, "attach", PHONE, "--wait", "0.1")
    assert (code, "still being connected to" in out) == (1, True)
    with staffed.database.writing() as session:
        note_states(session, "lab", {PHONE: "device"})
    code, out, _ = rayfarm(staffed, capsys, "attach", PHONE)
    assert (code, f"{PHONE} is attached" in out) == (0, True)
    with staffed.database.writing() as session:
        session.execute(update(Worker).values(beat_at=now() - timedelta(hours=1)))
        note_states(session, "lab", {})
    code, out, _ = rayfarm(staffed, capsys, "attach", PHONE, "--json")
    assert (code, "rayfarm worker" in json.loads(out)["advice"]) == (1, True)


def test_clear_and_forget_in_the_terminal(staffed: Service, capsys: pytest.CaptureFixture[str]) -> None:
    add_phone(staffed, set_aside="3 false hits.", address=PHONE)
    assert rayfarm(staffed, capsys, "clear", PHONE)[:2] == (0, f"{PHONE} is ready.\n")
    assert rayfarm(staffed, capsys, "forget", PHONE)[:2] == (0, f"{PHONE} is forgotten.\n")
    code, out, err = rayfarm(staffed, capsys, "forget", PHONE)
    assert (code, out) == (2, "")
    assert "no device" in err


def test_a_wrong_code_in_the_terminal_is_one_sentence(staffed: Service, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = rayfarm(staffed, capsys, "pair", PHONE, "98765")
    assert (code, out) == (2, "")
    assert "six digits" in err
    assert "98765" not in err


def test_a_page_of_another_origin_may_not_attach(staffed: Service) -> None:
    refused = staffed.client.post("/api/v1/devices", json={"address": PHONE}, headers={"Origin": "http://evil.example"})
    assert refused.status_code == 403
