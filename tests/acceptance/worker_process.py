"""A worker process whose slices hang: `worker_process.py URL MARK LEASE_S` touches MARK when it holds one."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from renderer.child import AsyncSay
from server.cli.service import GIVEN_UP
from server.processes import Told, signalled
from server.queue.durable import Durable
from server.queue.ledger import Claim
from server.store.database import Database
from server.worker import Worker


async def hang(_held: Claim, _say: AsyncSay) -> dict[str, Any]:
    Path(sys.argv[2]).touch()
    await asyncio.sleep(60)
    return {}


def main() -> int:
    told = signalled()
    database = Database(sys.argv[1])
    worker = Worker(
        database,
        Durable(database),
        hang,
        lambda _request, _measurements: {},
        host="there",
        lease_s=float(sys.argv[3]),
        poll_s=0.05,
    )
    return run_until_told(worker, told)


def run_until_told(worker: Worker, told: Told, started: Callable[[], object] = lambda: None) -> int:
    """Run a worker, telling that it is `started`, until it is `told` to end or given up; the process's exit code."""
    worker.start()
    started()
    while not told.wait(0.02) and not worker.given_up:
        pass
    given_up = worker.given_up
    worker.stop()
    return GIVEN_UP if given_up else 0


if __name__ == "__main__":
    sys.exit(main())
