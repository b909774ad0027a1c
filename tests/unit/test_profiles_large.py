"""Large files in bounded memory: a process whose own data may not grow beyond a limit imports them."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LIMIT = 64 << 20
"""What the import may take beyond what the process has when all is loaded, in bytes."""
METRICS = ("SP Memory Read (Bytes / Second)", "% Time ALUs Working", "% Shader ALU Capacity Utilized", "FPS[1]")

# One value in all rows of a round, so that every figure is known; RLIMIT_DATA counts what is allocated, not the file.
PROGRAM = """
import json, resource, sys
from pathlib import Path
import numpy, pandas
from server.profiles import reader
small = Path(sys.argv[2])
reader.read_profile(small)
used = int(next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmData:"))) * 1024
resource.setrlimit(resource.RLIMIT_DATA, (used + int(sys.argv[3]),) * 2)
found = reader.read_profile(Path(sys.argv[1]))
print(json.dumps([found.rows, [[s.series.name, s.count, s.mean, s.median, s.min, s.max] for s in found.summaries]]))
"""


def write_profile(path: Path, megabytes: int) -> int:
    """Write a realtime file of a size; return how many rounds of METRICS it has, round n with the value n."""
    written, rounds = 0, 0
    with path.open("w", encoding="utf-8-sig") as file:
        written += file.write("Process,Category,Metric,Timestamp,TimestampRaw,Value\n")
        while written < megabytes * 10**6:
            rows = (
                f"com.example.app,GPU,{metric},{number * 50},{number * 50_000},{number}\n"
                for number in range(rounds, rounds + 5000)
                for metric in METRICS
            )
            written += file.write("".join(rows))
            rounds += 5000
    return rounds


@pytest.mark.parametrize("megabytes", [40, pytest.param(200, marks=pytest.mark.long)])
def test_a_large_file_needs_little_memory(tmp_path: Path, megabytes: int) -> None:
    large, small = tmp_path / "large.csv", tmp_path / "small.csv"
    rounds = write_profile(large, megabytes)
    write_profile(small, 1)
    command = [sys.executable, "-c", PROGRAM, str(large), str(small), str(LIMIT)]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)
    assert ended.returncode == 0, ended.stderr[-1000:]
    rows, figures = json.loads(ended.stdout)
    middle = (rounds - 1) / 2
    names = [name.partition(" (")[0].removesuffix("[1]") for name in METRICS]
    assert rows == rounds * len(METRICS)
    assert figures == [[name, rounds, middle, middle, 0.0, rounds - 1.0] for name in names]


def test_the_limit_is_one(tmp_path: Path) -> None:
    """The same process cannot hold the file whole."""
    large, small = tmp_path / "large.csv", tmp_path / "small.csv"
    write_profile(large, 40)
    write_profile(small, 1)
    greedy = PROGRAM.replace("found =", "held = pandas.read_csv(sys.argv[1])\nfound =")
    command = [sys.executable, "-c", greedy, str(large), str(small), str(LIMIT)]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)
    assert ended.returncode != 0
    assert "MemoryError" in ended.stderr or "out of memory" in ended.stderr


@pytest.mark.parametrize("stray", ['"', "x" * (5 << 20)], ids=["an open quote", "an endless row"])
def test_a_broken_large_file_is_refused_early(tmp_path: Path, stray: str) -> None:
    large, small = tmp_path / "large.csv", tmp_path / "small.csv"
    write_profile(large, 40)
    write_profile(small, 1)
    text = large.read_text(encoding="utf-8-sig")
    half = text.index("\n", 1000) + 1
    large.write_text(text[:half] + stray + text[half:], encoding="utf-8")
    command = [sys.executable, "-c", PROGRAM, str(large), str(small), str(LIMIT)]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)
    assert "ProfileError: The file is no CSV: a row has more than" in ended.stderr
