"""How many submissions a second a service takes, and how fast it answers each.

`python -m benchmarks.load`: on SQLite and on a PostgreSQL of its own that flushes every commit; 200 a second for a
minute beside an idle worker, then beside a rendering worker, faster and faster until one in twenty waits for 250 ms.
Requests are sent by the clock whatever came of those before, and timed from when they were due. All on loopback, and
bounded.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from sqlalchemy import func, select

from server.service import listen
from server.store.database import Database
from server.store.models import Job, Slice

LIMIT_MS = 250.0
CONNECTIONS = 64
CEILING_RATES = (25, 50, 75, 100, 150, 200, 300)
STEP_S = 15.0
BODY = json.dumps({"scene": "cornell-box", "size": 64, "frames": 1, "rounds": 1}).encode()
"""One slice: each further round of a job is one more workflow to enqueue."""
KINDS = ("postgresql", "sqlite")


@dataclass
class Load:
    """What came of one load: milliseconds of each answer from when its request was due, and those not accepted."""

    rate: float
    seconds: float
    times_ms: list[float] = field(default_factory=list)
    refused: list[int] = field(default_factory=list)
    took_s: float = 0.0

    def percentile(self, q: float) -> float:
        return float(np.percentile(self.times_ms, q)) if self.times_ms else float("nan")

    def __str__(self) -> str:
        p50, p95, p99 = (self.percentile(q) for q in (50, 95, 99))
        done = len(self.times_ms) - len(self.refused)
        return (
            f"{self.rate:5.0f}/s for {self.seconds:.0f} s: {done} accepted, {len(self.refused)} refused, "
            f"{len(self.times_ms) / self.took_s:.0f}/s answered; p50 {p50:.0f}, p95 {p95:.0f}, p99 {p99:.0f}, "
            f"max {max(self.times_ms):.0f} ms"
        )


async def submit_all(port: int, rate: float, seconds: float, prefix: str) -> Load:
    """Submit at a rate for so long over kept connections, each submission with a key of its own."""
    load = Load(rate, seconds)
    count = int(rate * seconds)
    due: asyncio.Queue[int | None] = asyncio.Queue()
    begun = time.perf_counter()

    async def sender() -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        while (number := await due.get()) is not None:
            writer.write(
                b"POST /api/v1/jobs HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
                b"Idempotency-Key: %s-%d\r\nContent-Length: %d\r\n\r\n%s" % (prefix.encode(), number, len(BODY), BODY)
            )
            head = await reader.readuntil(b"\r\n\r\n")
            length = next(int(line[15:]) for line in head.lower().split(b"\r\n") if line.startswith(b"content-length:"))
            await reader.readexactly(length)
            load.times_ms.append((time.perf_counter() - begun - number / rate) * 1e3)
            if head[9:12] != b"201":
                load.refused.append(int(head[9:12]))
        writer.close()

    senders = [asyncio.create_task(sender()) for _ in range(CONNECTIONS)]
    for number in range(count):
        await asyncio.sleep(max(0.0, begun + number / rate - time.perf_counter()))
        due.put_nowait(number)
    for _ in senders:
        due.put_nowait(None)
    await asyncio.gather(*senders)
    load.took_s = time.perf_counter() - begun
    return load


@contextmanager
def verb(environment: dict[str, str], *words: str) -> Iterator[subprocess.Popen[bytes]]:
    """A verb of the CLI as a process."""
    command = [sys.executable, "-m", "server.cli.app", *words]
    quiet = {"RAYFARM_LOG_LEVEL": "warning", "RAYFARM_PHONES": "off"}
    process = subprocess.Popen(command, env=os.environ | environment | quiet, stdout=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.terminate()
        process.wait(60)


@contextmanager
def store(kind: str, folder: Path) -> Iterator[str]:
    """The URL of a fresh database."""
    if kind == "sqlite":
        yield f"sqlite:///{folder / 'load.sqlite'}"
        return
    sys.path.append(str(Path(__file__).parents[1] / "tests"))
    from postgres import find_binaries, running_cluster

    binaries = find_binaries()
    if binaries is None:
        raise SystemExit("PostgreSQL's server programs are not installed: apt install postgresql")
    durable = ("fsync=on", "full_page_writes=on", "synchronous_commit=on", "shared_buffers=128MB")
    with running_cluster(binaries, *durable) as cluster, cluster.database() as url:
        yield url


def wait_for_server(port: int) -> None:
    import httpx

    for _ in range(600):
        try:
            if httpx.get(f"http://127.0.0.1:{port}/readyz", trust_env=False).is_success:
                return
        except httpx.TransportError:
            time.sleep(0.1)
    raise SystemExit("The server did not start.")


def cpu_s(process: subprocess.Popen[bytes]) -> float:
    """The CPU seconds that a process has taken."""
    fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def count(database: Database) -> tuple[int, int]:
    """The jobs, and those of their slices that the queue knows or knew."""
    with database.reading() as session:
        jobs = session.scalar(select(func.count(Job.id))) or 0
        slices = session.scalar(select(func.count(Slice.id)).where(Slice.workflow.is_not(None))) or 0
    return jobs, slices


def check_none_lost(database: Database, accepted: int) -> None:
    jobs, slices = count(database)
    lost = "none lost" if (jobs, slices) == (accepted, accepted) else "LOST SOME"
    print(f"  {accepted} accepted, {jobs} jobs and {slices} slices stored: {lost}", flush=True)


def measure(kind: str, rate: float, seconds: float, ceiling: bool) -> None:
    """One database: beside an idle worker at one rate, then beside a rendering one at rising rates."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="rayfarm-load-")))
        url = stack.enter_context(store(kind, folder))
        environment = {"RAYFARM_DATABASE_URL": url, "RAYFARM_BLOBS": str(folder / "blobs")}
        sock = listen("127.0.0.1", 0)
        port = int(sock.getsockname()[1])
        sock.close()
        serving = stack.enter_context(verb(environment, "serve", "--no-worker", "--port", str(port)))
        wait_for_server(port)
        database = Database(url)
        stack.callback(database.close)
        accepted = 0
        with verb(environment | {"RAYFARM_LLVMPIPE": "off"}, "worker"):
            time.sleep(5)
            before = cpu_s(serving)
            load = asyncio.run(submit_all(port, rate, seconds, "idle"))
            each_ms = (cpu_s(serving) - before) / len(load.times_ms) * 1e3
            print(f"{kind}, beside an idle worker: {load}; the server's CPU {each_ms:.1f} ms each", flush=True)
        accepted += len(load.times_ms) - len(load.refused)
        check_none_lost(database, accepted)
        with verb(environment, "worker") if ceiling else nullcontext():
            time.sleep(10 if ceiling else 0)
            best = 0.0
            for step in CEILING_RATES if ceiling else ():
                load = asyncio.run(submit_all(port, step, STEP_S, f"busy{step}"))
                accepted += len(load.times_ms) - len(load.refused)
                print(f"{kind}, beside a rendering worker: {load}", flush=True)
                if load.percentile(95) > LIMIT_MS or load.refused:
                    break
                best = step
            if ceiling:
                print(f"{kind}, beside a rendering worker: the ceiling is {best:.0f}/s at p95 under {LIMIT_MS:.0f} ms")
                check_none_lost(database, accepted)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("databases", nargs="*", metavar="DATABASE", help="postgresql, sqlite; both unless told")
    parser.add_argument("--rate", type=float, default=200.0)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--no-ceiling", dest="ceiling", action="store_false")
    options = parser.parse_args()
    for kind in options.databases or KINDS:
        if kind not in KINDS:
            raise SystemExit(f"{kind} is no database: choose from {', '.join(KINDS)}.")
        measure(kind, min(options.rate, 2000.0), min(options.seconds, 600.0), options.ceiling)


if __name__ == "__main__":
    main()
