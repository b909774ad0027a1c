"""A worker whose slices only take time: `chaos_worker.py URL LOG LEASE_S`."""

from __future__ import annotations

import sys
import zlib
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[1] / "acceptance"))

from service_fakes import document
from sqlalchemy import update
from worker_process import run_until_told

from renderer.child import AsyncSay, run_child_async
from renderer.process import end_with_parent
from renderer.request import Request
from server.processes import signalled
from server.queue.dispatch import settle
from server.queue.durable import Durable
from server.queue.ledger import Claim
from server.store.database import Database
from server.store.models import Device
from server.worker import Worker

HOST = "chaos"


def main(url: str, log: str, lease_s: float, parent: int) -> int:
    end_with_parent(parent)
    told = signalled()
    database = Database(url)

    async def run_slice(held: Claim, say: AsyncSay) -> dict[str, Any]:
        # From 0.05 to 0.55 s, by the job alone.
        seconds = 0.05 + zlib.crc32(str(held.job_id).encode()) % 500 / 1000
        task = {"job": held.job_id, "device": held.device, "seconds": seconds, "log": log}
        has_lease = worker.has_lease
        return await run_child_async("chaos_slice", task, 1, 60, say, lease_s=lease_s / 2, has_lease=has_lease)

    def combine(request: Request, measurements: list[dict[str, Any]]) -> dict[str, Any]:
        return document(request, measurements[0]["speed"])

    durable = Durable(database)
    worker = Worker(database, durable, run_slice, combine, host=HOST, lease_s=lease_s, poll_s=0.1)
    return run_until_told(worker, told, lambda: show_devices(database, durable))


def show_devices(database: Database, durable: Durable) -> None:
    """Show this host's devices, as a worker's tracker does: they are away once all workers were lost."""
    with database.writing() as session:
        shown = update(Device).where(Device.host == HOST)
        session.execute(shown.values(presence="online", advice=None))
    settle(database, durable)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2], float(sys.argv[3]), int(sys.argv[4])))
