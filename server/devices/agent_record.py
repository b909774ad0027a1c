"""The agent's result record, version 1 (`agent_android/README.md`): read only when it is whole and this run's own."""

from __future__ import annotations

import hashlib
import json
import math
import mmap
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, TypeVar

from renderer.plan import PlanError
from server.devices.words import plain

MAGIC = b"RAYRSLT\0"
END = b"RAYDONE\0"
VERSION = 1
MAX_HEADER = 16 << 20
_HEAD, _TAIL = 16, 40
_ALIGN = 16
OUTCOMES = ("done", "refused", "failed", "deadline")

_T = TypeVar("_T")


class RecordError(PlanError):
    """A record that is torn, foreign or not understood; the message is one sentence."""


@dataclass(frozen=True)
class FrameTimes:
    """One frame's times in nanoseconds; None where the agent could not tell."""

    wall: int
    cpu: int | None
    gpu: int | None
    disjoint: bool


@dataclass(frozen=True, eq=False)
class Blob:
    """What was read back: a buffer's name or `image`, its rectangle in pixels, and its bytes."""

    name: str
    tile: tuple[int, int, int, int]
    data: memoryview


@dataclass(frozen=True, eq=False)
class AgentRecord:
    """What one command of the agent came to.

    `compile_ms`, `upload_ms` and `warm_up_ms` are 0 where they are not said. Texts in `reason` are plain; those in
    `device`, `samples` and `unavailable` are as the phone gave them.
    """

    outcome: str
    reason: str | None
    device: Mapping[str, Any]
    compile_ms: float
    upload_ms: float
    warm_up_ms: float
    frames: tuple[FrameTimes, ...]
    samples: Mapping[str, Any]
    unavailable: Mapping[str, Any]
    blobs: tuple[Blob, ...]


def read_record(path: Path, token: str, version: str) -> AgentRecord:
    """Read a record's file, as `map_record` does; the file may be removed afterwards."""
    with path.open("rb") as file:
        return map_record(file, token, version)


def map_record(file: IO[bytes], token: str, version: str) -> AgentRecord:
    """Read a record; raise RecordError unless it is whole, of this run (`token`) and of this agent (`version`).

    The blobs lie in a mapping of the file, which may be closed afterwards.
    """
    size = file.seek(0, 2)
    if size < _HEAD + _TAIL:
        raise RecordError("The agent's record is torn: it is shorter than an empty one.")
    data = memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
    header, base = _read_header(data)
    if header.get("token") != token:
        raise RecordError("The agent's record is of another run: its token differs.")
    if header.get("agent") != version:
        raise RecordError(f"The phone runs agent {plain(header.get('agent'))}; this is {version}.")
    return _record(header, data[base : size - _TAIL])


def _read_header(data: memoryview) -> tuple[dict[str, Any], int]:
    """The header and where it ends, once the record proved to be whole."""
    if data[:8] != MAGIC:
        raise RecordError("What the agent left is no record: its first bytes are wrong.")
    version, length = struct.unpack_from("<II", data, 8)
    if version != VERSION:
        raise RecordError(f"The agent's record has version {version}; version {VERSION} is read here.")
    if data[-_TAIL : -_TAIL + 8] != END:
        raise RecordError("The agent's record is torn: its end mark is missing.")
    if hashlib.sha256(data[:-_TAIL]).digest() != data[-32:]:
        raise RecordError("The agent's record is torn: it fails its checksum.")
    base = _HEAD + length
    if length > MAX_HEADER or base > len(data) - _TAIL:
        raise RecordError(f"The agent's record is not understood: its header says it has {length} bytes.")
    try:
        header = json.loads(bytes(data[_HEAD:base]))
    except (ValueError, RecursionError) as error:
        raise RecordError("The agent's record is not understood: its header is no JSON.") from error
    return _of_kind(header, dict, "header"), base


def _record(header: dict[str, Any], blobs: memoryview) -> AgentRecord:
    outcome = header.get("outcome")
    if outcome not in OUTCOMES:
        raise _misunderstood("outcome")
    reason = header.get("reason")
    return AgentRecord(
        outcome=outcome,
        reason=None if reason is None else plain(reason, 400),
        device=_of_kind(header.get("device", {}), dict, "device"),
        compile_ms=_milliseconds(header, "compile_ms"),
        upload_ms=_milliseconds(header, "upload_ms"),
        warm_up_ms=_milliseconds(header, "warm_up_ms"),
        frames=tuple(_frame(entry) for entry in _of_kind(header.get("frames", []), list, "frames")),
        samples=_of_kind(header.get("samples", {}), dict, "samples"),
        unavailable=_of_kind(header.get("unavailable", {}), dict, "unavailable"),
        blobs=tuple(_blob(entry, blobs) for entry in _of_kind(header.get("blobs", []), list, "blobs")),
    )


def _frame(entry: Any) -> FrameTimes:
    fields = _of_kind(entry, dict, "frames")
    wall = _count(fields.get("wall_ns"), "wall_ns")
    if wall == 0:
        raise _misunderstood("wall_ns")
    cpu, gpu = (None if fields.get(name) is None else _count(fields[name], name) for name in ("cpu_ns", "gpu_ns"))
    return FrameTimes(wall, cpu, gpu, fields.get("disjoint") is True)


def _blob(entry: Any, data: memoryview) -> Blob:
    fields = _of_kind(entry, dict, "blobs")
    x, y, width, height, offset, nbytes = (
        _count(fields.get(name), name) for name in ("x", "y", "width", "height", "offset", "bytes")
    )
    name = fields.get("name")
    if not isinstance(name, str):
        raise _misunderstood("blobs")
    content = data[offset : offset + nbytes]
    if offset % _ALIGN or len(content) != nbytes:
        raise RecordError(f"The agent's record is not understood: its blob {plain(name)} lies outside of it.")
    if hashlib.sha256(content).hexdigest() != fields.get("sha256"):
        raise RecordError(f"The agent's record is torn: its blob {plain(name)} fails its checksum.")
    return Blob(name, (x, y, width, height), content)


def _of_kind(value: Any, kind: type[_T], what: str) -> _T:
    if not isinstance(value, kind):
        raise _misunderstood(what)
    return value


def _count(value: Any, what: str) -> int:
    if type(value) is not int or not 0 <= value < 1 << 62:
        raise _misunderstood(what)
    return value


def _milliseconds(header: dict[str, Any], name: str) -> float:
    value = header.get(name, 0)
    if type(value) not in (int, float) or not math.isfinite(value) or value < 0:
        raise _misunderstood(name)
    return float(value)


def _misunderstood(what: str) -> RecordError:
    return RecordError(f"The agent's record is not understood: its {what} is wrong.")
