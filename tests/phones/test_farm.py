"""The farm as a whole, on two phones and llvmpipe: one at a time on each, unplugged, cancelled, hung, limited, hostile.

One service serves all of these tests, in any order: each leaves its phones ready and as found.
"""

from __future__ import annotations

import csv
import io
import re
import time
from collections.abc import Callable, Iterator

import pytest

from agent_android.standin.adb_server import AdbServer
from agent_android.standin.phone import StandInPhone
from phones.agent_phones import agents, assert_as_found, build_agent
from phones.conftest import started
from phones.farm import (
    SLICE_TIMEOUT_S,
    Farm,
    Json,
    assert_one_at_a_time,
    assert_recorded_once,
    at_once,
    farming,
    stop_amid,
    was_retried,
)
from phones.standin_helpers import wait_until
from server.cli import app as cli
from server.comparison.flat import FORMULA
from server.slices import AGENT_SHARE
from server.store.states import OPEN

HOSTILE = '=HYPERLINK("http://x"),<script>alert(1)</script><img src=x onerror=alert(1)>\';$(reboot)`id`|\x1b[2J\u202e'
FLOOD = 2 << 20
"""Bytes that one phone's `app_process` writes on each of its outputs before anything else."""


@pytest.fixture(scope="module")
def farm(adb: AdbServer, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Farm]:
    build_agent()
    folder = tmp_path_factory.mktemp("farm")
    with started(StandInPhone(folder / "a")) as plain, started(StandInPhone(folder / "b")) as hostile:
        hostile.persona.set_model(HOSTILE)
        hostile.persona.set_flood(FLOOD, FLOOD)
        with farming(adb, (plain, hostile), folder) as one:
            yield one


@pytest.fixture
def phone(farm: Farm) -> Iterator[StandInPhone]:
    """The plain phone, as it was at first."""
    yield from _lent(farm, farm.phones[0])


@pytest.fixture
def other_phone(farm: Farm) -> Iterator[StandInPhone]:
    """The hostile phone, as it was at first."""
    yield from _lent(farm, farm.phones[1])


def _lent(farm: Farm, phone: StandInPhone) -> Iterator[StandInPhone]:
    farm.when_ready(phone)
    yield phone
    phone.persona.set_environment()
    wait_until(lambda: not farm.device(phone)["running"])
    assert_as_found(phone)


def test_a_study_over_phones_and_llvmpipe(farm: Farm, phone: StandInPhone, other_phone: StandInPhone) -> None:
    axes = {"traversal": "bvh-stack,kd-backtrack", "method": "compute"}
    study = farm.study("llvmpipe", phone.serial, other_phone.serial, axes=axes, size=96, rounds=1)
    jobs = farm.finished(study)
    assert [job["state"] for job in jobs] == ["done"] * 6, [job["reason"] for job in jobs]
    assert_one_at_a_time(jobs)
    of = {device: [job for job in jobs if job["device"] == device] for device in (phone.serial, other_phone.serial)}
    assert at_once(of[phone.serial], of[other_phone.serial])
    table = farm.get(farm.get(study["url"])["results"] + "&cells=results")
    cells = [(row["key"], cell["result"]) for row in table["table"] for cell in row["cells"]]
    assert len(cells) == table["results"] == 6
    assert {key["device"] for key, _ in cells} == {"llvmpipe", phone.serial, other_phone.serial}
    assert {result["rays_primary"] for _, result in cells} == {96 * 96}
    assert len({(result["rays_shadow"], result["rays_timed"]) for _, result in cells}) == 1
    wrong = ("error_false_hit", "error_false_miss", "error_wrong_primitive", "error_shadow_mismatch", "overflows")
    assert {result[name] for _, result in cells for name in wrong} == {0}


def unplug_pushing(_farm: Farm, phone: StandInPhone) -> None:
    stop_amid(phone, "plan")
    phone.kill()


def unplug_running(_farm: Farm, phone: StandInPhone) -> None:
    """The GPU hangs, so that there is no end to come before."""
    phone.persona.set_environment(RAYFARM_SHIM_HANG="finish:3")
    wait_until(lambda: (phone.local_tmp / "rayfarm/plan").exists(), 60.0)
    wait_until(lambda: agents(phone), 60.0)
    phone.kill()
    phone.persona.set_environment()


def unplug_pulling(_farm: Farm, phone: StandInPhone) -> None:
    stop_amid(phone, "record")
    phone.kill()


@pytest.mark.parametrize(
    ("unplug", "scene", "size"),
    [
        pytest.param(unplug_pushing, "forest", 64, id="pushing the plan"),
        pytest.param(unplug_running, "cornell-box", 64, id="running the plan"),
        pytest.param(unplug_pulling, "cornell-box", 384, id="pulling the record"),
    ],
)
def test_unplugged_its_job_waits_and_is_recorded_once(
    farm: Farm,
    phone: StandInPhone,
    unplug: Callable[[Farm, StandInPhone], None],
    scene: str,
    size: int,
    request: pytest.FixtureRequest,
) -> None:
    asked = farm.job(phone, scene=scene, size=size)
    unplug(farm, phone)
    wait_until(lambda: phone.processes() == [])
    job = farm.wait(asked, lambda now: now["reason"] == f"{phone.serial} is not ready.")
    assert job["state"] == "waiting"
    doing = request.node.callspec.id
    lost = [change for change in job["changes"] if f"went away while {doing}" in (change["reason"] or "")]
    assert [change["state"] for change in lost] == ["queued"]
    assert lost[0]["reason"].endswith("Attempt 2 follows.")
    assert farm.children() == []
    assert phone.processes() == []
    plugged = time.monotonic()
    phone.restart()
    job = farm.ended(asked)
    print(f"plugged in again, done after {time.monotonic() - plugged:.1f} s")
    assert was_retried(job)
    assert_recorded_once(farm, job)


def test_an_adb_server_killed_amid_a_job_costs_an_attempt(farm: Farm, phone: StandInPhone, adb: AdbServer) -> None:
    asked = farm.job(phone)
    phone.persona.set_environment(RAYFARM_SHIM_HANG="finish:3")
    wait_until(lambda: agents(phone), 60.0)
    adb.kill()
    phone.persona.set_environment()
    try:
        job = farm.ended(asked)
        assert was_retried(job)
        assert_recorded_once(farm, job)
    finally:
        # The farm had another server started, which is no child of ours.
        adb.client().server_kill()
        wait_until(lambda: not adb._answers())
        adb.start()
        farm.when_ready(*farm.phones)


def test_a_cancelled_job_frees_its_phone_once_its_child_is_gone(farm: Farm, phone: StandInPhone) -> None:
    long = farm.job(phone, size=256, frames=1000)
    after = farm.job(phone)
    farm.wait(long, lambda now: now["state"] == "running")
    wait_until(lambda: agents(phone) and (phone.local_tmp / "rayfarm/plan").exists(), 60.0)
    children = set(farm.children())
    assert len(children) == 2
    asked = time.monotonic()
    assert farm.post(f"jobs/{long['id']}/cancel")["state"] == "cancelled"
    answered = time.monotonic()

    def is_freed() -> bool:
        return long["id"] not in [part["job"] for part in farm.device(phone)["running"]]

    wait_until(is_freed, 5.0)
    assert not children & set(farm.children())
    freed = time.monotonic()
    # The next job's agent takes longer to come than this one's to go.
    wait_until(lambda: agents(phone) == [], 5.0)
    took = f"answered after {answered - asked:.2f} s, freed {freed - answered:.2f} s later"
    print(f"cancel {took}, agent gone after {time.monotonic() - answered:.2f} s")
    assert_recorded_once(farm, farm.ended(after))
    ended = farm.get(long["url"])
    assert (ended["changes"][-1]["state"], ended["result"]) == ("cancelled", None)


def test_a_phone_that_hangs_ends_at_its_deadline_and_holds_up_nobody(
    farm: Farm, phone: StandInPhone, other_phone: StandInPhone
) -> None:
    phone.persona.set_environment(RAYFARM_SHIM_HANG="finish:3")
    begun = time.monotonic()
    hung, after = farm.job(phone), farm.job(phone)
    # Reset at once: the farm gives the phone its next job before anyone could after the first one's end.
    wait_until(lambda: _runs_a_plan(phone), 60.0)
    phone.persona.set_environment()
    studies = [farm.study(other_phone.serial, name=name, axes={"method": "compute"}) for name in ("one", "two")]
    jobs = [job for study in studies for job in farm.finished(study)]
    assert {job["study"] for job in jobs} == {study["id"] for study in studies}
    for job in jobs:
        assert_recorded_once(farm, job)
    assert_one_at_a_time(jobs)
    job = farm.wait(hung, lambda now: now["state"] == "failed")
    print(f"hung: ended after {time.monotonic() - begun:.1f} s")
    assert at_once(jobs, [job])
    # The agent ends itself; on a machine so busy that preparing took long, its leash comes first.
    agent_s = SLICE_TIMEOUT_S * AGENT_SHARE
    assert re.search(rf"within its deadline of {agent_s} s|after {SLICE_TIMEOUT_S:g} s, its time limit", job["reason"])
    assert not was_retried(job)
    assert_recorded_once(farm, farm.ended(after))


def _runs_a_plan(phone: StandInPhone) -> bool:
    """Whether the agent runs a plan there, so that what was in its environment is read."""
    words = " ".join(word for one in phone.processes() for word in one.command)
    return (phone.local_tmp / "rayfarm/plan").exists() and "lwjgl" in words


def test_a_phone_set_aside_parks_its_jobs_until_it_is_cleared(farm: Farm, phone: StandInPhone) -> None:
    """Its system is updated in the middle of a study, and then computes nothing."""
    axes = {"method": "fragment", "traversal": "bvh-stack,kd-backtrack,bvh-parent-link"}
    study = farm.study(phone.serial, axes=axes)
    farm.wait(study, lambda now: now["slices"]["done"])
    phone.kill()
    phone.persona.set_property("ro.build.fingerprint", "rayfarm/standin/standin:15/UPDATED/1:userdebug/test-keys")
    phone.persona.set_environment(RAYFARM_SHIM_LIMITS="MAX_COMPUTE_SHADER_STORAGE_BLOCKS=0")
    phone.restart()
    wait_until(lambda: farm.device(phone)["set_aside"], 60.0)
    assert "COMPUTE_SHADER_STORAGE_BLOCKS = 0" in farm.device(phone)["set_aside"]
    wait_until(lambda: not farm.device(phone)["running"], 60.0)
    parked = farm.wait(study, lambda now: {job["state"] for job in _open(now)} == {"waiting"})
    assert {job["reason"] for job in _open(parked)} == {f"{phone.serial} is not ready."}
    time.sleep(2.0)
    assert farm.get(study["url"])["slices"] == parked["slices"]
    phone.persona.set_environment()
    farm.post(f"devices/{phone.serial}/clear")
    for job in farm.finished(study):
        assert_recorded_once(farm, job)


def _open(study: Json) -> list[Json]:
    return [job for job in study["jobs"] if job["state"] in OPEN]


@pytest.fixture(scope="module")
def limited(farm: Farm) -> tuple[Json, dict[str, Json]]:
    """A study on the hostile phone, which has no storage blocks for fragments, and its jobs by method."""
    hostile = farm.phones[1]
    farm.when_ready(hostile)
    hostile.persona.set_environment(RAYFARM_SHIM_LIMITS="MAX_FRAGMENT_SHADER_STORAGE_BLOCKS=0")
    study = farm.study(hostile.serial, axes={"method": "fragment,hybrid,compute"}, rounds=1)
    jobs = farm.finished(study)
    hostile.persona.set_environment()
    return study, {job["request"]["variant"]["method"]: job for job in jobs}


def test_a_phone_without_storage_for_fragments_refuses_and_computes(
    farm: Farm, limited: tuple[Json, dict[str, Json]]
) -> None:
    _, jobs = limited
    for method in ("fragment", "hybrid"):
        refused = "This device offers GL_MAX_FRAGMENT_SHADER_STORAGE_BLOCKS = 0; the plan needs "
        assert jobs[method]["state"] == "failed"
        assert jobs[method]["reason"].startswith(refused)
        assert not was_retried(jobs[method])
    assert_recorded_once(farm, jobs["compute"])


def test_what_a_phone_says_is_inert_on_every_page(farm: Farm, limited: tuple[Json, dict[str, Json]]) -> None:
    study, jobs = limited
    assert jobs["compute"]["result"]["device"]["name"].startswith("=HYPERLINK")
    table, result = farm.get(study["url"])["page"], jobs["compute"]["page"]
    lists = ("/devices", "/studies", study["url"].removeprefix("/api/v1"), jobs["hybrid"]["page"])
    for path in (table, f"{table}&chart=error", result, *lists):
        page = farm.page(path)
        assert not [word for word in ("<script>alert", "<img", "\x1b", "\u202e") if word in page], path
        assert "&lt;script&gt;alert(1)" in page or path not in (result, "/devices")


@pytest.mark.parametrize("shape", ["long", "table"])
def test_what_a_phone_says_is_no_formula(farm: Farm, limited: tuple[Json, dict[str, Json]], shape: str) -> None:
    study, _ = limited
    text = farm.page(f"/api/v1/compare?format=csv&study={study['id']}&shape={shape}")
    [header, line] = csv.reader(io.StringIO(text))
    assert len(line) == len(header)
    assert shape == "table" or line[header.index("device_name")].startswith("'=HYPERLINK")
    assert not [field for field in (*header, *line) if field.startswith(FORMULA)]


def test_what_a_phone_says_is_inert_in_a_terminal(
    farm: Farm, limited: object, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.run(["devices", "--server", str(farm.client.base_url)]) == 0
    printed, _ = capsys.readouterr()
    assert "=HYPERLINK(" in printed
    assert "\x1b" not in printed
