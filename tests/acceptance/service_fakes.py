"""A real server on a free loopback port and a real database file, with a stand-in for the measurement alone."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx

from renderer.child import AsyncSay
from renderer.request import Request
from renderer.variant import AXES
from server.queue.durable import Durable
from server.queue.ledger import Claim
from server.service import address, listen, running
from server.settings import Settings
from server.store.database import Database
from server.worker import Combine, RunSlice, Worker

SPEEDS = dict.fromkeys(AXES["traversal"], 0.5) | {
    "brute-force": 0.01,
    "bvh-stack": 2.0,
    "bvh-parent-link": 1.4,
    "bvh-restart-trail": 1.1,
    "kd-push-down": 0.9,
    "kd-backtrack": 0.6,
}
HOST = "here"
POLL_S = 0.05
LEASE_S = 4.0


@dataclass
class FakeBench:
    """Stands for `renderer.bench`: remembers the order of slices, fails where told to."""

    order: list[tuple[str, str, int]] = field(default_factory=list)
    failing: dict[str, Exception] = field(default_factory=dict)
    device: str = "llvmpipe"

    async def run_slice(self, held: Claim, say: AsyncSay) -> dict[str, Any]:
        """One round, at once."""
        request = Request.from_json(held.request)
        traversal = request.variant.traversal
        self.order.append((request.scene, traversal, held.round))
        if traversal in self.failing:
            raise self.failing[traversal]
        for phase in ("running", "judging"):
            await say(phase)
        return {"round": held.round, "speed": SPEEDS[traversal]}

    def combine(self, request: Request, measurements: list[dict[str, Any]]) -> dict[str, Any]:
        """A result whose speed is the traversal's in SPEEDS."""
        speed = sum(m["speed"] for m in measurements) / len(measurements)
        return document(request, speed, self.device)


def document(request: Request, speed: float, device: str = "llvmpipe") -> dict[str, Any]:
    """A result; `speed` in Mray/s, 20 ms a frame with 10 % to either side."""
    hybrid = request.variant.method == "hybrid"
    return {
        "scene": request.scene,
        "family": "fake",
        "triangles": 1234,
        "device": {"id": device, "kind": "llvmpipe", "name": device, "driver": "Mesa"},
        **request.variant.as_dict(),
        "sah": {
            "traversal": request.costs.traversal,
            "intersection": request.costs.intersection,
            "cost": 31.5,
            "epo": 4.0,
        },
        "size": list(request.size),
        "rays_kind": request.rays,
        "frames": request.frames,
        "frame_ms": {"median": 20.0, "ci_low": 18.0, "ci_high": 22.0},
        "fps": 50.0,
        "mrays_per_s": speed,
        "mrays_per_cpu_s": speed * 0.9,
        "rays_timed": 1000,
        "rays": {"primary": 600, "shadow": 400},
        "structure_bytes": 65_536,
        "primitive_bytes": 4_096,
        "build_ms": 12.5,
        "per_ray": {"nodes": 34.25, "inner": 30.0, "leaves": 4.25, "triangles": 5.5, "bytes": 1200.0, "lines": None},
        "overflows": 0,
        "error": {
            "false_hit": 0.0,
            "false_miss": float("nan") if hybrid else 2e-5,
            "edge": 1e-4,
            "wrong_primitive": 0.0,
            "t_rel_p99": 1e-7,
            "t_rel_max": 1e-6,
            "t_ulp_max": 3,
            "shadow_mismatch": 0.0,
            "flip": None,
        },
        "vs_embree": {"mrays_per_cpu_s": 4.0, "ratio": speed * 0.9 / 4.0} if request.vs_embree else None,
        "specialised": ["normals"],
        "versions": {"rayfarm": "0.1.0", "shader_sha": "ab" * 8, "plan": 1},
        "started_at": "2026-01-01T00:00:00+00:00",
    }


@dataclass
class Service:
    """A running server, a client for it, and its database and queue."""

    client: httpx.Client
    database: Database
    durable: Durable
    bench: FakeBench
    folder: Path
    database_url: str

    def work(self) -> None:
        """Measure everything that is queued."""
        with self.working() as worker:
            wait_for(worker.is_idle, 60)

    @contextmanager
    def working(self, run_slice: RunSlice | None = None, combine: Combine | None = None) -> Iterator[Worker]:
        """A worker in this process, by default the bench's."""
        make = combine or self.bench.combine
        worker = Worker(
            self.database,
            self.durable,
            run_slice or self.bench.run_slice,
            make,
            host=HOST,
            lease_s=LEASE_S,
            poll_s=POLL_S,
        )
        worker.start()
        try:
            yield worker
        finally:
            worker.stop()

    def post(self, path: str, **body: Any) -> Any:
        """POST a body that is fine; the answer's JSON."""
        answer = self.client.post(f"/api/v1/{path}", json=body)
        assert answer.status_code == 201, answer.text
        return answer.json()

    def get(self, path: str) -> Any:
        """GET what is there; the answer's JSON."""
        answer = self.client.get(f"/api/v1/{path}")
        assert answer.status_code == 200, answer.text
        return answer.json()


@contextmanager
def running_service(folder: Path, database_url: str | None = None, **settings: Any) -> Iterator[Service]:
    """A service on a database, by default one in `folder`, with other settings where they are given."""
    url = database_url or f"sqlite:///{folder / 'service.sqlite'}"
    sock = listen("127.0.0.1", 0)
    base = address(sock)
    with running(Settings(database_url=url, **settings), sock, with_worker=False):
        database = Database(url)
        durable = Durable(database)
        try:
            with httpx.Client(base_url=base, timeout=30, trust_env=False) as client:
                yield Service(client, database, durable, FakeBench(), folder, url)
        finally:
            durable.close()
            database.close()


def wait_for(condition: Callable[[], object], seconds: float = 20.0) -> None:
    """Wait until a condition holds; fail when it does not in time."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, f"nothing happened in {seconds} s"
        time.sleep(0.02)
