"""The registry of devices, on SQLite and on PostgreSQL."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import timedelta
from itertools import pairwise, product
from typing import Any

import pytest
from sqlalchemy import select

from renderer.request import Request
from server.devices import registry, wanted
from server.devices.presence import STATES, note_states
from server.devices.registry import DeviceError
from server.store.database import Database
from server.store.models import Device, Job, Worker, now

LEASE_S = 60.0
HEALTH: tuple[Any, ...] = (None, {"passed": True}, {"passed": False, "reason": "x"}, {"passed": False, "cleared": True})


@pytest.fixture
def database(database_url: str) -> Iterator[Database]:
    opened = Database(database_url)
    yield opened
    opened.close()


def add(database: Database, **values: Any) -> None:
    with database.writing() as session:
        session.add(Device(**{"id": "p", "kind": "phone", "host": "here", "presence": "online", "facts": {}} | values))


def get(database: Database, device_id: str = "p") -> Device:
    with database.reading() as session:
        return session.get_one(Device, device_id)


def note(database: Database, states: dict[str, str], host: str = "here", trouble: str | None = None) -> set[str]:
    with database.writing() as session:
        return note_states(session, host, states, trouble)


def test_the_rule_is_the_same_in_python_and_in_sql(database: Database) -> None:
    presences = ("connecting", "online", "offline", "unauthorized")
    cases = list(product(("twin", "phone", "pairing"), presences, (None, "broken"), range(len(HEALTH))))
    for number, (kind, presence, set_aside, health) in enumerate(cases):
        add(database, id=str(number), kind=kind, presence=presence, set_aside=set_aside, health=HEALTH[health])
    with database.reading() as session:
        devices = session.scalars(select(Device)).all()
        in_sql = set(session.scalars(select(Device.id).where(registry.is_ready())))
    assert in_sql == {device.id for device in devices if registry.ready(device)}
    told = {cases[int(number)] for number in in_sql}
    assert told == {("twin", "online", None, h) for h in range(4)} | {("phone", "online", None, h) for h in (1, 3)}


def test_a_failed_check_sets_aside_until_cleared(database: Database) -> None:
    add(database)
    with database.writing() as session:
        registry.record_health(session, "p", {"passed": False, "reason": "3 false hits"})
    assert get(database).set_aside == "3 false hits"
    with database.writing() as session:
        registry.clear(session.get_one(Device, "p"))
    assert registry.ready(get(database))
    with database.writing() as session:
        registry.record_health(session, "p", {"passed": False, "reason": "4 false hits"})
    assert not registry.ready(get(database))


def test_what_was_forgotten_is_not_written_to(database: Database) -> None:
    with database.writing() as session:
        registry.record_facts(session, "p", {"name": "x"})
        registry.record_health(session, "p", {"passed": True})
        wanted.answer_attaching(session, "p", "x")
    with database.reading() as session:
        assert session.scalars(select(Device)).all() == []


def test_facts_are_added_to_those_known(database: Database) -> None:
    add(database, facts={"name": "x", "battery": 1})
    with database.writing() as session:
        registry.record_facts(session, "p", {"battery": 2})
    assert get(database).facts == {"name": "x", "battery": 2}


@pytest.mark.parametrize("state", sorted(STATES))
def test_each_state_of_adbs_is_shown_with_what_to_do(database: Database, state: str) -> None:
    online = note(database, {"p": state})
    device = get(database)
    assert (device.kind, device.host, device.presence) == ("phone", "here", STATES[state][0])
    assert (device.advice is None) == (device.presence in ("online", "connecting"))
    assert online == ({"p"} if state == "device" else set())


def test_a_phone_that_is_not_listed_is_to_be_plugged_in(database: Database) -> None:
    add(database)
    add(database, id="h:5555", address="h:5555")
    add(database, id="there", host="elsewhere")
    assert note(database, {}) == set()
    assert "plug it in" in str(get(database).advice)
    assert "by itself" in str(get(database, "h:5555").advice)
    assert get(database, "there").presence == "online"


def test_trouble_with_adb_is_the_advice(database: Database) -> None:
    add(database)
    note(database, {}, trouble="No adb server.")
    assert (get(database).presence, get(database).advice) == ("offline", "No adb server.")


def test_a_phone_belongs_to_one_host(database: Database) -> None:
    note(database, {"p": "device"}, "one")
    assert note(database, {"p": "device"}, "two") == set()
    assert get(database).host == "one"
    note(database, {}, "one")
    assert note(database, {"p": "device"}, "two") == {"p"}
    assert get(database).host == "two"


def test_a_host_that_is_gone_takes_its_devices_offline(database: Database) -> None:
    add(database)
    add(database, id="q", host="there")
    with database.writing() as session:
        registry.see_twin(session, "here")
        wanted.want_pairing(session, "h:1", "123456", "here")
        registry.host_gone(session, "here")
    for device_id in ("p", "llvmpipe@here"):
        assert get(database, device_id).presence == "offline"
        assert "No worker runs on here" in str(get(database, device_id).advice)
    with database.writing() as session:
        assert session.get_one(Device, "q").presence == "online"
        assert session.get(Device, "pair@h:1") is None
        registry.see_twin(session, "here")
    assert registry.ready(get(database, "llvmpipe@here"))


def test_a_host_whose_worker_came_meanwhile_is_not_gone(database: Database) -> None:
    with database.writing() as session:
        session.add(Worker(id="w", host="here"))
        registry.see_twin(session, "here")
        registry.host_gone(session, "here")
    assert registry.ready(get(database, "llvmpipe@here"))


def test_asking_twice_is_asking_once(database: Database) -> None:
    for _ in range(2):
        with database.writing() as session:
            wanted.want(session, "h:5555", "here", {"here"})
    note(database, {"h:5555": "device"})
    with database.writing() as session:
        assert wanted.want(session, "h:5555", None, {"here"}).presence == "online"
        assert wanted.want(session, "h:5555", "there", {"here", "there"}).presence == "connecting"
    with database.reading() as session:
        [device] = session.scalars(select(Device)).all()
    assert (device.host, device.address) == ("there", "h:5555")


def test_a_phone_that_is_to_come_says_when_nobody_can_connect(database: Database) -> None:
    with database.writing() as session:
        assert "start `rayfarm worker`" in str(wanted.want(session, "h:5555", "here", set()).advice)
        assert wanted.want(session, "h:5555", "here", {"here"}).advice is None
        assert wanted.want(session, "i:5555", None, set()).host is None
        wanted.claim_unclaimed(session, "here")
        session.flush()
        assert [row.host for row in wanted.poll(session, "here")] == ["here", "here"]
        assert session.get_one(Device, "i:5555").advice is None


def test_a_code_is_taken_once_and_gone(database: Database) -> None:
    with database.writing() as session:
        wanted.want_pairing(session, "h:1", "123456", "here")
    with database.writing() as session:
        assert wanted.take_pairings(session, "there") == []
        assert wanted.take_pairings(session, "here") == [("pair@h:1", "h:1", "123456")]
    assert get(database, "pair@h:1").facts == {"address": "h:1"}
    with database.writing() as session:
        assert wanted.take_pairings(session, "here") == []
        wanted.answer_pairing(session, "pair@h:1", True, "Paired.")
        session.get_one(Device, "pair@h:1").seen_at = now() - wanted.PAIRING_KEPT - timedelta(seconds=1)
    assert not registry.ready(get(database, "pair@h:1"))
    with database.writing() as session:
        wanted.take_pairings(session, "here")
    with database.reading() as session:
        assert session.get(Device, "pair@h:1") is None


def test_devices_in_use_are_not_forgotten(database: Database) -> None:
    add(database, id="h:5555", address="h:5555")
    add(database)
    with database.writing() as session:
        session.add(Worker(id="w", host="here"))
        session.add(Job(scene="x", label="x", request=Request("x").to_json(), device="h:5555"))
        registry.see_twin(session, "here")
    refusals = {"h:5555": "1 job is still open", "p": "unplug it first", "llvmpipe@here": "end that first"}
    for device_id, words in refusals.items():
        with database.writing() as session, pytest.raises(DeviceError, match=words):
            registry.forget(session, session.get_one(Device, device_id), LEASE_S)
    with database.writing() as session:
        session.get_one(Job, 1).state = "done"
        session.get_one(Worker, "w").beat_at = now() - timedelta(seconds=LEASE_S + 1)
    with database.writing() as session:
        for device in session.scalars(select(Device)):
            registry.forget(session, device, LEASE_S)
    with database.reading() as session:
        assert session.scalars(select(Device)).all() == []


def test_retries_are_at_once_when_asked_then_rarer(database: Database) -> None:
    retries = wanted.Retries()

    def due(presence: str, at: float, state: str | None = None, busy: frozenset[str] = frozenset()) -> list[str]:
        row = wanted.Row("h:1", "phone", "here", "h:1", presence, False)
        return retries.due([row], {} if state is None else {"h:1": state}, at, busy)

    assert due("connecting", 0.0) == ["h:1"]
    assert due("connecting", 0.1, busy=frozenset({"h:1"})) == []
    tried = [at for at in range(1, 200) if due("offline", float(at))]
    gaps = [b - a for a, b in pairwise(tried)]
    assert gaps == sorted(gaps)
    assert (gaps[0], gaps[-1]) == (2, 30)
    assert due("online", 200.0, "device") == []
    assert due("offline", 200.5, "offline") == []
    assert due("offline", 202.0, "offline") == ["h:1"]
    assert retries.due([], {}, 203.0) == []
