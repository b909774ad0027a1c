"""Writes records as the agent does (`agent_android/README.md`), and as it never would."""

from __future__ import annotations

import hashlib
import json
import struct
from pathlib import Path
from typing import Any

TOKEN = "5f" * 16
AGENT = "0.1.0+0123456789ab"
IMAGE = bytes(range(64))
TILE = bytes(range(100, 140))


def header(**changes: Any) -> dict[str, Any]:
    """A header as of a run with two blobs, with some of its fields changed."""
    return {
        "token": TOKEN,
        "agent": AGENT,
        "outcome": "done",
        "reason": None,
        "device": {"gl_renderer": "Adreno (TM) 740", "limits": {"COMPUTE_SHADER_STORAGE_BLOCKS": 24}},
        "compile_ms": 12.5,
        "upload_ms": 3,
        "warm_up_ms": 20.25,
        "frames": [{"wall_ns": 5_000_000_000, "cpu_ns": None, "gpu_ns": 4_999_000_000, "disjoint": False}],
        "samples": {"gpu_clock": {"file": "/sys/class/kgsl/kgsl-3d0/gpuclk", "values": ["585000000"]}},
        "unavailable": {"gpu_temp": "denied"},
        "blobs": [blob("records", TILE, 0, (0, 0, 2, 2)), blob("image", IMAGE, 48, (0, 0, 4, 4))],
        **changes,
    }


def blob(name: str, data: bytes, offset: int, tile: tuple[int, int, int, int], **changes: Any) -> dict[str, Any]:
    """A blob's entry in the header."""
    x, y, width, height = tile
    place = {"name": name, "x": x, "y": y, "width": width, "height": height, "offset": offset, "bytes": len(data)}
    return {**place, "sha256": hashlib.sha256(data).hexdigest(), **changes}


def record(given: Any = None, *, version: int = 1, length: int | None = None) -> bytes:
    """The bytes of a whole record; `length` lies about its header's."""
    text = given if isinstance(given, bytes) else json.dumps(header() if given is None else given).encode()
    head = b"RAYRSLT\0" + struct.pack("<II", version, len(text) if length is None else length) + text
    data = head + TILE + bytes(8) + IMAGE
    return data + b"RAYDONE\0" + hashlib.sha256(data).digest()


def written(folder: Path, data: bytes) -> Path:
    """A file of it."""
    path = folder / "record"
    path.write_bytes(data)
    return path
