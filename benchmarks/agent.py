"""The agent's frame time beside the twin's: `python -m benchmarks.agent [SCENE ...]`.

Both run the same plans on llvmpipe with one thread, in rounds that alternate within one run; the agent is its shipped
DEX over the desktop shim, in a process of its own. Ratios are of medians, round by round. Prints a Markdown table.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
from pathlib import Path
from statistics import median
from typing import Any

from agent_android.build import build_desktop
from renderer.locks import holding, machine_lock
from renderer.plan import Plan
from renderer.prepare import prepare
from renderer.request import Request, parse_size
from renderer.twin import Twin, open_context
from renderer.variant import Variant
from server.devices.agent_record import read_record

AGENT = Path(__file__).parents[1] / "agent_android"
MAIN = "org.rayfarm.agent.Main"
METHODS = ("fragment", "compute", "hybrid")
TRAVERSALS = ("bvh-stack", "kd-backtrack")
Times = tuple[float, float]
"""Medians of wall and CPU time of one round's frames, in milliseconds."""


def built() -> str:
    return str(build_desktop()["version"])


def run_agent(plan: Path, version: str, frames: int) -> Times:
    out = plan.with_suffix(".record")
    words = ["run", "--version", version, "--token", "benchmark", "--out", str(out), "--deadline", "600"]
    words += ["--plan", str(plan), "--frames", str(frames), "--warm-up", "1"]
    run = [str(AGENT / "desktop" / "run.sh"), str(AGENT / "build" / "agent-desktop.jar"), MAIN, *words]
    with subprocess.Popen(run, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL) as process:
        process.wait()
    record = read_record(out, "benchmark", version)
    if record.outcome != "done":
        raise SystemExit(record.reason)
    return median(f.wall / 1e6 for f in record.frames), median((f.cpu or 0) / 1e6 for f in record.frames)


def run_twin(context: Any, plan: Plan, frames: int) -> Times:
    twin = Twin(context, plan)
    twin.setup()
    twin.frame()
    times = twin.time_frames(frames)
    twin.release()
    return median(times.wall) * 1e3, median(times.cpu) * 1e3


def rounds(context: Any, request: Request, version: str, options: argparse.Namespace) -> list[tuple[Times, Times]]:
    """The twin's and the agent's times, by round; every second round the agent goes first."""
    plan = prepare(request).plan(instrument=False)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plan"
        plan.save(path)
        times: list[tuple[Times, Times]] = []
        for index in range(options.rounds):
            if index % 2:
                agent = run_agent(path, version, options.frames)
                times.append((run_twin(context, plan, options.frames), agent))
            else:
                twin = run_twin(context, plan, options.frames)
                times.append((twin, run_agent(path, version, options.frames)))
        return times


def row(request: Request, times: list[tuple[Times, Times]]) -> str:
    twin, agent = (median(pair[side][0] for pair in times) for side in (0, 1))
    wall, cpu = (sorted(pair[1][clock] / pair[0][clock] for pair in times) for clock in (0, 1))
    variant = request.variant
    figures = f"{twin:.1f} | {agent:.1f} | {median(wall):.3f} ({wall[0]:.3f} to {wall[-1]:.3f}) | {median(cpu):.3f}"
    return f"| {request.scene} | {variant.method} | {variant.traversal} | {figures} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", default=["crytek-sponza"])
    parser.add_argument("--size", type=parse_size, default=(512, 512))
    parser.add_argument("--rounds", type=int, default=4)
    parser.add_argument("--frames", type=int, default=5)
    options = parser.parse_args()
    os.environ["LP_NUM_THREADS"] = "1"
    version = built()
    context = open_context()
    print("| scene | method | traversal | twin ms | agent ms | agent/twin wall (least to most) | CPU |")
    print("|---|---|---|---:|---:|---:|---:|", flush=True)
    for scene in options.scenes:
        for method in METHODS:
            for traversal in TRAVERSALS:
                request = Request(scene, Variant(traversal, method), options.size)
                with holding(machine_lock()):
                    print(row(request, rounds(context, request, version, options)), flush=True)


if __name__ == "__main__":
    main()
