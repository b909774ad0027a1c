"""A whole farm: `rayfarm serve` with its worker, a private adb server, two stand-in phones with the shipped agent."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import httpx

from agent_android.standin.adb_server import AdbServer
from agent_android.standin.phone import StandInPhone
from phones.standin_helpers import wait_until
from server.store.states import OPEN

Json = dict[str, Any]

SOON_S = 180.0
"""Patience with what takes seconds here; the machine may be busy."""
SLICE_TIMEOUT_S = 60.0
CHILDREN = ("renderer.leash", "server.devices.phone_slice")
_LARGE = 1 << 20


class Farm:
    """A running service and its phones."""

    def __init__(self, serving: subprocess.Popen[str], client: httpx.Client, phones: tuple[StandInPhone, ...]) -> None:
        self.serving, self.client, self.phones = serving, client, phones

    def post(self, path: str, **body: Any) -> Json:
        """POST to the API; the answer's JSON."""
        answer = self.client.post(f"/api/v1/{path}", json=body)
        assert answer.is_success, answer.text
        found: Json = answer.json()
        return found

    def get(self, path: str) -> Json:
        """GET from the API; the answer's JSON."""
        answer = self.client.get(path if path.startswith("/api") else f"/api/v1/{path}")
        assert answer.is_success, answer.text
        found: Json = answer.json()
        return found

    def page(self, path: str) -> str:
        """A page's HTML, or another text."""
        answer = self.client.get(path)
        assert answer.is_success, answer.text
        return answer.text

    def job(self, phone: StandInPhone, **body: Any) -> Json:
        """Submit a job on a phone: one quick slice unless told otherwise."""
        usual: Json = {"scene": "cornell-box", "method": "compute", "size": 64, "frames": 1, "check": "none"}
        return self.post("jobs", device=phone.serial, **usual | body)

    def study(self, *devices: str, **body: Any) -> Json:
        """Submit a study of the Cornell box on devices."""
        usual: Json = {"name": "farm", "scenes": ["cornell-box"], "size": 64, "frames": 2, "rounds": 2}
        return self.post("studies", devices=list(devices), **usual | body)

    def device(self, phone: StandInPhone) -> Json:
        """A phone as the farm shows it."""
        return self.get(f"devices/{phone.serial}")

    def wait(self, what: Json, holds: Callable[[Json], object], patience_s: float = SOON_S) -> Json:
        """A job, a study or a device once it is as wanted."""
        wait_until(lambda: holds(self.get(what["url"])), patience_s)
        return self.get(what["url"])

    def ended(self, job: Json) -> Json:
        """A job at its end."""
        return self.wait(job, lambda now: now["state"] not in OPEN)

    def finished(self, study: Json) -> list[Json]:
        """A study's jobs, whole, once all have ended."""
        after = self.wait(study, lambda now: now["state"] == "done")
        return [self.get(job["url"]) for job in after["jobs"]]

    def when_ready(self, *phones: StandInPhone) -> None:
        """Return once jobs may run on the phones."""
        for phone in phones:
            wait_until(lambda phone=phone: self.device(phone)["ready"], SOON_S)  # type: ignore[misc]

    def children(self) -> list[int]:
        """The processes that measure slices on phones, and those that hold them on their leash."""
        return [pid for pid in _below(self.serving.pid) if any(name in _words(pid) for name in CHILDREN)]


@contextmanager
def farming(
    adb: AdbServer, phones: tuple[StandInPhone, ...], folder: Path, slice_timeout_s: float = SLICE_TIMEOUT_S
) -> Iterator[Farm]:
    """A farm whose phones are attached and ready; everything on them and under it has ended with the block."""
    settings = {
        "RAYFARM_PHONES": "on",
        "RAYFARM_DATABASE_URL": f"sqlite:///{folder / 'farm.sqlite'}",
        "RAYFARM_SLICE_TIMEOUT_S": str(slice_timeout_s),
        "RAYFARM_WORKER_HOST": "farm",
    }
    command = [sys.executable, "-m", "server.cli.app", "serve", "--port", "0", "--json"]
    with ExitStack() as stack:
        log = stack.enter_context((folder / "serve.log").open("w"))
        serving = subprocess.Popen(
            command, env=os.environ | adb.environment | settings, stdout=subprocess.PIPE, stderr=log, text=True
        )
        stack.callback(_end, serving)
        client = httpx.Client(base_url=_address(serving), timeout=60.0, trust_env=False)
        farm = Farm(serving, stack.enter_context(client), phones)
        for phone in phones:
            farm.post("devices", address=phone.serial)
        farm.when_ready(*phones)
        wait_until(lambda: any(one["kind"] == "twin" for one in farm.get("devices")["devices"]), SOON_S)
        yield farm
        serving.send_signal(signal.SIGTERM)
        assert serving.wait(40.0) == 0
        wait_until(lambda: not any(phone.processes() for phone in phones))


def spans(job: Json) -> list[tuple[str, str]]:
    """When a job ran on its device, as its history tells: from `running` to what came next."""
    return [(a["at"], b["at"]) for a, b in pairwise(job["changes"]) if a["state"] == "running"]


def assert_one_at_a_time(jobs: list[Json]) -> None:
    """No two of these jobs ran on one device at once, and each ran."""
    assert all(spans(job) for job in jobs)
    for device in {job["device"] for job in jobs}:
        ran = sorted(span for job in jobs if job["device"] == device for span in spans(job))
        assert all(end <= begin for (_, end), (begin, _) in pairwise(ran)), (device, ran)


def at_once(ours: list[Json], theirs: list[Json]) -> bool:
    """Whether some two of their spans overlap."""
    ran = [(ours_ran, theirs_ran) for o in ours for t in theirs for ours_ran in spans(o) for theirs_ran in spans(t)]
    return any(a[0] < b[1] and b[0] < a[1] for a, b in ran)


def assert_recorded_once(farm: Farm, job: Json) -> None:
    """The job is done, said so once, and has one result."""
    assert job["state"] == "done", job["reason"]
    assert [change["state"] for change in job["changes"]].count("done") == 1
    assert job["result"] is not None
    rows = farm.page(f"/api/v1/compare?format=csv&device={job['device']}").splitlines()
    assert [row.split(",", 1)[0] for row in rows].count(str(job["id"])) == 1


def was_retried(job: Json) -> bool:
    """Whether a slice of the job was run, or was to be run, a second time."""
    return any("ttempt" in (change["reason"] or "") for change in job["changes"])


def stop_amid(phone: StandInPhone, name: str) -> None:
    """Wait until the phone's adbd is in the middle of writing or reading a large file of the agent, and stop it there.

    Stopped, it is looked at again: what is in the middle now stays so until it is killed.
    """
    adbd = _adbd(phone)
    deadline = time.monotonic() + SOON_S
    while time.monotonic() < deadline:
        if _is_amid(adbd, phone, name):
            os.kill(adbd, signal.SIGSTOP)
            if _is_amid(adbd, phone, name):
                return
            os.kill(adbd, signal.SIGCONT)
        time.sleep(0.001)
    raise AssertionError(f"adbd was never seen in the middle of {name}")


def _is_amid(adbd: int, phone: StandInPhone, name: str) -> bool:
    """Whether adbd has the file open, is past its beginning, and has not passed all of what is there."""
    try:
        file = (phone.local_tmp / "rayfarm" / name).stat()
        for entry in Path(f"/proc/{adbd}/fd").iterdir():
            if os.path.samestat(entry.stat(), file):
                place = int(Path(f"/proc/{adbd}/fdinfo/{entry.name}").read_text().split()[1])
                return place > _LARGE and (name == "plan" or place < file.st_size)
    except OSError:
        return False
    return False


def _adbd(phone: StandInPhone) -> int:
    """Its process id on this machine."""
    here = {pid: _words(pid) for pid in _below(os.getpid()) if phone._runs_here(Path(f"/proc/{pid}"))}
    [found] = [pid for pid, words in here.items() if "/adbd" in words and "supervise.sh" not in words]
    return found


def _below(root: int) -> list[int]:
    """A process's descendants."""
    parents = {}
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            parents[int(entry.parent.name)] = int(entry.read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
    found, fresh = [], [root]
    while fresh:
        fresh = [pid for pid, parent in parents.items() if parent in fresh]
        found += fresh
    return found


def _words(pid: int) -> str:
    """A process's command line; empty once it is gone or only waits to be reaped."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes().decode(errors="replace").replace("\0", " ")
    except OSError:
        return ""


def _address(serving: subprocess.Popen[str]) -> str:
    assert serving.stdout is not None
    said = ""
    for line in serving.stdout:
        said += line
        if line == "}\n":
            return str(json.loads(said)["address"])
    raise AssertionError("rayfarm serve ended before it served")


def _end(serving: subprocess.Popen[str]) -> None:
    if serving.poll() is None:
        serving.kill()
    serving.wait()
    assert serving.stdout is not None
    serving.stdout.close()
