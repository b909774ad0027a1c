"""The phone's agent as a host: pushes plans over adb, has them run, and reads the records back."""

from __future__ import annotations

import contextlib
import secrets
import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import IO, Any, Protocol

import numpy as np

from renderer.host import WARM_UP, DeviceGoneError, Frames, Tile, Timed
from renderer.locks import device_lock
from renderer.plan import Buffer, Plan, PlanError, refuse_beyond
from server.devices.adb import Phone, PhoneError
from server.devices.agent_package import BUILD, find_agent
from server.devices.agent_record import MAX_HEADER, AgentRecord, Blob, RecordError, map_record
from server.devices.apk_way import ApkWay
from server.devices.counters import find_counters, read_condition, samples_of
from server.devices.properties import read_properties
from server.devices.shell_way import ShellWay
from server.devices.words import WordError, plain

DEADLINE_S = 300.0
"""Seconds that one command of the agent may take."""
GRACE_S = 15.0
_SMALL = 1 << 20


class Way(Protocol):
    """How the agent comes in: by the shell or as an app. Methods raise DeviceGoneError and PhoneError."""

    name: str

    def clear(self, *, fresh: bool) -> None:
        """End what an earlier run left running, remove its files; `fresh` makes ready for a run."""

    def send(self, plan: IO[bytes] | None) -> None:
        """Push the agent and a plan."""

    def run(self, verb: str, options: Sequence[str], deadline_s: float) -> None:
        """Run a command to its end."""

    def fetch(self, record: IO[bytes], most: int) -> None:
        """Pull its record, of at most `most` bytes."""


class AgentHost:
    """Runs plans on the phone with this serial. It finds the phone as any run leaves it, and leaves it as found.

    `deadline_s` bounds each command of the agent (a probe, an instrumented run, a timed run). Errors are PlanError
    with one sentence, and DeviceGoneError when the phone went away.
    """

    paces = False

    def __init__(
        self,
        serial: str,
        via: str = "shell",
        deadline_s: float = DEADLINE_S,
        grace_s: float = GRACE_S,
        build: Path = BUILD,
    ) -> None:
        """Raise PlanError for a serial or a way that is none, or when the agent is not built."""
        self._phone = Phone(serial)
        self._package = find_agent(build)
        if via not in ("shell", "apk"):
            raise WordError(f"{plain(via)!r} is no way in: choose shell or apk.")
        make = ShellWay if via == "shell" else ApkWay
        self._way: Way = make(self._phone, self._package, grace_s)
        self._deadline_s = deadline_s

    @property
    def lock(self) -> Path:
        """The phone's."""
        return device_lock(self._phone.serial)

    def probe(self) -> AgentRecord:
        """What the phone is, with its GLES limits and precision; asked once."""
        return self._probed

    def device(self) -> dict[str, Any]:
        """What the phone and its driver say of themselves, made plain."""
        said, properties = self._probed.device, self._properties
        return {
            "id": self._phone.serial,
            "kind": "agent",
            "name": properties["model"] or self._phone.serial,
            "driver": plain(said.get("gl_version", "")),
            "vendor": plain(said.get("gl_vendor", "")),
            "renderer": plain(said.get("gl_renderer", "")),
            "glsl": plain(said.get("glsl_version", "")),
            "egl": plain(said.get("egl_version", "")),
            **{name: value for name, value in properties.items() if name != "model"},
            "via": self._way.name,
            "agent": self._package.version,
        }

    def limits(self) -> dict[str, int]:
        """The device's limits by GL name without `GL_MAX_`."""
        limits = self._probed.device.get("limits")
        given = limits.items() if isinstance(limits, dict) else ()
        return {plain(name): value for name, value in given if type(value) is int}

    def collect(self, plan: Plan) -> list[Tile]:
        """Run one frame of an instrumented plan."""
        collected = {step.collect for step in plan.passes if step.collect is not None}
        buffers = {buffer.name: buffer for buffer in plan.buffers if buffer.name in collected}
        tiles = -(-plan.size[0] // plan.tile[0]) * -(-plan.size[1] // plan.tile[1])
        most = tiles * sum(buffer.nbytes + _SMALL for buffer in buffers.values())
        record = self._run_plan(plan, 1, 0, {}, most)
        return [_tile(blob, buffers, plan) for blob in record.blobs if blob.name in buffers]

    def measure(self, plan: Plan, frames: int, between: Callable[[], None]) -> Timed:
        """Time frames; `between` is not called, because a phone's frames run on without us."""
        counters, missing = self._counters
        before = read_condition(self._phone)
        width, height = plan.size
        record = self._run_plan(plan, frames, WARM_UP, counters, width * height * 4 + _SMALL)
        after = read_condition(self._phone)
        samples = samples_of(counters, missing, record.samples, record.unavailable, before, after)
        if len(record.frames) != frames:
            raise RecordError(f"The agent timed {len(record.frames)} frames of {frames}.")
        compile_s = (record.compile_ms + record.upload_ms + record.warm_up_ms) / 1e3
        return Timed(self._times(record), compile_s, _image(record, plan), samples)

    def _times(self, record: AgentRecord) -> Frames:
        """Wall times, and the processor's where it is the GPU: its GL timers do not (docs/method.md, Time)."""
        wall = [frame.wall / 1e9 for frame in record.frames]
        if "llvmpipe" in plain(record.device.get("gl_renderer", "")):
            cpu = [(frame.cpu or 0) / 1e9 for frame in record.frames]
            # Android counts a process's time in steps of up to 10 ms: shorter frames have none that can be told.
            return Frames(wall, cpu if all(cpu) else [])
        gpu = [None if frame.gpu is None or frame.disjoint else frame.gpu / 1e9 for frame in record.frames]
        timed = any(frame.gpu is not None or frame.disjoint for frame in record.frames)
        return Frames(wall, [], gpu if timed else [])

    def _run_plan(self, plan: Plan, frames: int, warm_up: int, counters: Mapping[str, str], most: int) -> AgentRecord:
        refuse_beyond(self.limits(), plan)
        options = ["--frames", str(frames), "--warm-up", str(warm_up), *_samples(counters)]
        with _saved(plan) as file:
            return self._run("run", options, file, most)

    def _run(self, verb: str, options: Sequence[str], plan: IO[bytes] | None, most: int) -> AgentRecord:
        token = secrets.token_hex(16)
        with tempfile.TemporaryFile() as fetched:
            try:
                self._way.clear(fresh=True)
                self._way.send(plan)
                identity = ["--version", self._package.version, "--token", token]
                self._way.run(verb, [*identity, *options], self._deadline_s)
                self._way.fetch(fetched, most + MAX_HEADER)
            finally:
                # A phone that is out of reach is cleared at the start of its next run.
                with contextlib.suppress(DeviceGoneError, PhoneError):
                    self._way.clear(fresh=False)
            fetched.flush()
            record = map_record(fetched, token, self._package.version)
        if record.outcome != "done":
            raise PlanError(record.reason or f"The agent ended with the outcome {record.outcome} and no reason.")
        return record

    @cached_property
    def _probed(self) -> AgentRecord:
        return self._run("probe", _samples(self._counters[0]), None, _SMALL)

    @cached_property
    def _counters(self) -> tuple[dict[str, str], dict[str, str]]:
        return find_counters(self._phone)

    @cached_property
    def _properties(self) -> dict[str, str | None]:
        return read_properties(self._phone)


def _saved(plan: Plan) -> IO[bytes]:
    """The plan in a file without a name, so that a caller that is killed leaves none."""
    with tempfile.TemporaryDirectory(prefix="rayfarm-plan-") as folder:
        path = Path(folder, "plan")
        plan.save(path)
        return path.open("rb")


def _samples(counters: Mapping[str, str]) -> list[str]:
    return [word for name, path in counters.items() for word in ("--sample", f"{name}={path}")]


def _tile(blob: Blob, buffers: Mapping[str, Buffer], plan: Plan) -> Tile:
    x, y, width, height = blob.tile
    inside = 0 < width <= plan.tile[0] and 0 < height <= plan.tile[1]
    if (
        not inside
        or x + width > plan.size[0]
        or y + height > plan.size[1]
        or len(blob.data) != buffers[blob.name].nbytes
    ):
        raise RecordError(f"The agent's tile {blob.tile} is not one of the plan's.")
    return blob.tile, np.frombuffer(blob.data, "<u4")


def _image(record: AgentRecord, plan: Plan) -> np.ndarray[Any, np.dtype[np.uint8]]:
    width, height = plan.size
    for blob in record.blobs:
        if blob.name == "image" and blob.tile == (0, 0, width, height) and len(blob.data) == width * height * 4:
            return np.frombuffer(blob.data, np.uint8).reshape(height, width, 4)
    raise RecordError(f"The agent's record holds no image of {width}x{height} pixels.")
