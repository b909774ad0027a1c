"""How long the service takes to answer with many stored results: `python -m benchmarks.pages`.

Fills a fresh database (`--database URL`, by default an SQLite file in a temporary folder), starts the service on a free
loopback port, and asks one address after the other, `--times` times each, the first answer apart: it fills the caches.
Prints a Markdown table of the median and the 95th percentile, and exits with 1 when one is over its limit.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median, quantiles

import httpx

from benchmarks.stored import fill
from server.service import address, listen, running
from server.settings import Settings
from server.store.database import Database

PAGE_MS, API_MS = 500.0, 300.0
PIVOT = "rows=traversal,method,layout&cols=scene,device"
BASELINE = "bvh-stack / fragment / normal"

ADDRESSES: tuple[tuple[str, float | None], ...] = (
    ("/", PAGE_MS),
    ("/?study=9", PAGE_MS),
    ("/?device=llvmpipe&layout=normal&rows=traversal,method", PAGE_MS),
    ("/?metric=per_ray_nodes&sort=-forest&method=compute", PAGE_MS),
    ("/?scene=forest&scene=conference&rows=traversal,layout&cols=scene,size", PAGE_MS),
    (f"/?{PIVOT}", PAGE_MS),
    (f"/?{PIVOT}&baseline={BASELINE}", PAGE_MS),
    ("/?rows=sah,specialise&cols=size,rays&sah=3.0,1.5", PAGE_MS),
    ("/?chart=size&baseline=bvh-stack", PAGE_MS),
    ("/?rows=study&cols=scene", PAGE_MS),
    ("/?rows=study&cols=scene&sort=forest", PAGE_MS),
    ("/studies", PAGE_MS),
    ("/studies/9", PAGE_MS),
    ("/jobs/777", PAGE_MS),
    ("/devices", PAGE_MS),
    ("/submit", PAGE_MS),
    ("/difference", PAGE_MS),
    ("/difference?baseline=study:9,traversal=bvh-stack&against=study:9,traversal=kd-backtrack", PAGE_MS),
    ("/api/v1/compare", API_MS),
    ("/api/v1/compare?study=9", API_MS),
    ("/api/v1/compare?device=llvmpipe&layout=normal&rows=traversal,method", API_MS),
    (f"/api/v1/compare?{PIVOT}", API_MS),
    (f"/api/v1/compare?{PIVOT}&baseline={BASELINE}", API_MS),
    ("/api/v1/compare?sah=3.0,1.5&specialise=on&size=256x256", API_MS),
    ("/api/v1/compare?format=markdown", API_MS),
    ("/api/v1/difference?baseline=job:1&against=job:2", API_MS),
    ("/api/v1/difference?baseline=study:9,traversal=bvh-stack&against=study:9,traversal=kd-backtrack", API_MS),
    ("/api/v1/compare?format=csv&shape=table", API_MS),
    ("/api/v1/jobs", API_MS),
    ("/api/v1/jobs?state=done&limit=1000", API_MS),
    ("/api/v1/jobs?scene=forest&before=5000", API_MS),
    ("/api/v1/jobs/777", API_MS),
    ("/api/v1/studies/9", API_MS),
    ("/api/v1/devices", API_MS),
)
"""What is asked for, and how long it may take in ms at the 95th percentile."""

EXPORTS = tuple(f"/api/v1/compare?format={form}" for form in ("csv", "jsonl", "parquet"))


@dataclass(frozen=True)
class Timed:
    """Answers of one address: times in ms, `first` that of the answer with cold caches; the size of one in bytes."""

    address: str
    limit: float | None
    first: float
    times: list[float]
    size: int

    @property
    def p95(self) -> float:
        """The 95th percentile."""
        return quantiles(self.times, n=20, method="inclusive")[-1] if len(self.times) > 1 else self.times[0]

    @property
    def line(self) -> str:
        """One row of the table."""
        limit = "" if self.limit is None else f"{self.limit:.0f}"
        figures = f"{self.first:.0f} | {median(self.times):.0f} | {self.p95:.0f} | {limit} | {self.size / 1e3:.0f}"
        return f"| `{self.address}` | {figures} |"


def timed(client: httpx.Client, path: str, limit: float | None, times: int) -> Timed:
    """Ask one address `times` times more than once."""
    taken, size = [], 0
    for _ in range(times + 1):
        begin = time.perf_counter()
        answer = client.get(path)
        taken.append((time.perf_counter() - begin) * 1e3)
        answer.raise_for_status()
        size = len(answer.content)
    return Timed(path, limit, taken[0], taken[1:], size)


@contextmanager
def filled(url: str | None, results: int) -> Iterator[str]:
    """The URL of a database with so many results, filled unless there are none to add; what was made of `url` stays."""
    with tempfile.TemporaryDirectory() as folder:
        url = url or f"sqlite:///{Path(folder) / 'pages.sqlite'}"
        database = Database(url)
        begin = time.perf_counter()
        studies = fill(database, results) if results else 0
        database.close()
        print(f"{results} results of {studies} studies written in {time.perf_counter() - begin:.0f} s", file=sys.stderr)
        yield url


def ask(url: str, times: int, exports: bool = True) -> Iterator[Timed]:
    """Start the service on a database and time every address, the exports of all results last."""
    sock = listen("127.0.0.1", 0)
    with (
        running(Settings(database_url=url), sock, with_worker=False),
        httpx.Client(base_url=address(sock), timeout=300, trust_env=False) as client,
    ):
        for path, limit in ADDRESSES:
            yield timed(client, path, limit, times)
        for path in EXPORTS if exports else ():
            yield timed(client, path, None, 1)


def main(arguments: Sequence[str] | None = None) -> int:
    """Read the command line, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--results", type=int, default=100_000, help="how many to add, 0 for a database filled before")
    parser.add_argument("--database", help="an empty database to fill, by default a temporary SQLite file")
    parser.add_argument("--quick", action="store_true", help="leave out the exports of all results")
    parser.add_argument("--times", type=int, default=20, help="answers of each address that are timed")
    options = parser.parse_args(arguments)
    late = []
    with filled(options.database, options.results) as url:
        print("| address | first ms | median ms | p95 ms | limit ms | KB |\n|---|---:|---:|---:|---:|---:|", flush=True)
        for one in ask(url, options.times, not options.quick):
            print(one.line, flush=True)
            late += [one.address] if one.limit is not None and one.p95 > one.limit else []
    for path in late:
        print(f"over its limit: {path}", file=sys.stderr)
    return 1 if late else 0


if __name__ == "__main__":
    sys.exit(main())
