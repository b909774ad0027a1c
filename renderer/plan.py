"""The plan: a variant made concrete for a scene. Texts, buffers, passes; no Python and no Java in it.

One file: the magic, the format's version and the header's length as little-endian uint32, the header's sha256, the JSON
header, then the buffers at 16-byte boundaries counted from the header's end. Every buffer and text carries its sha256.
"""

from __future__ import annotations

import hashlib
import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

MAGIC = b"RAYFARM\0"
VERSION = 3
HEAD = 48
"""Bytes before the header."""
_ALIGN = 16

GROUP = 8
"""Compute passes run work groups of 8x8, as `shaders/render_compute.comp` declares."""

TEXEL_WORDS = 4
"""Words in a texel of textures that hold data."""

Words = npt.NDArray[np.uint32]
Uniform = tuple[str, list[float]]
"""A type (`int`, `uint`, `float`, `ivec2`, `uvec2`, `vec2`, `vec3`, `mat4` in column order) and its values, flat; more
values than the type has are an array."""


class PlanError(ValueError):
    """A plan that cannot be read, or that a host cannot run; the message says why."""


@dataclass(frozen=True, eq=False)
class Buffer:
    """A storage or vertex buffer of `nbytes`; `data` is None for scratch that the device fills."""

    name: str
    nbytes: int
    data: Words | None = None


@dataclass(frozen=True, eq=False)
class Texture:
    """A texture: `rgba8`, `r32ui` or `depth24` of the image's size, or `rgba32ui` that holds `data`.

    The words of `data` fill its texels row by row, `width` to a row; the rest of the last row holds nothing.
    """

    name: str
    format: str
    width: int | None = None
    data: Words | None = None

    @property
    def texels(self) -> int:
        """The texels that `data` fills."""
        return 0 if self.data is None else len(self.data) // TEXEL_WORDS


@dataclass(frozen=True)
class Program:
    """Flattened texts by stage: `vertex` and `fragment`, or `compute`."""

    name: str
    stages: dict[str, str]


@dataclass(frozen=True)
class Pass:
    """One step of a frame.

    `kind`: `compute` (groups of 8x8 over each tile), `draw` (the full-screen quad, scissored to each tile), `raster`
    (`vertices` drawn whole with a depth test after clearing). `phase`: `setup` runs once, untimed; `frame` every
    frame. `storage` maps bindings, `textures` sampler uniforms and `images` image units to names; images of textures
    that hold data are read, others written. `target` names the colour texture (and depth texture) drawn into. `collect`
    names a buffer to read back after each tile.
    """

    name: str
    kind: str
    program: str
    phase: str = "frame"
    storage: dict[str, str] = field(default_factory=dict)
    textures: dict[str, str] = field(default_factory=dict)
    images: dict[str, str] = field(default_factory=dict)
    target: list[str] = field(default_factory=list)
    vertices: str | None = None
    uniforms: dict[str, Uniform] = field(default_factory=dict)
    collect: str | None = None


@dataclass(frozen=True, eq=False)
class Plan:
    """What a host runs. `size` in pixels; `tile` the largest part of the image that one submission covers; `output` the
    texture that holds the image; `uniforms` are shared by all passes; `needs` are device limits by GL name;
    `left_out` says what the scene did not need."""

    size: tuple[int, int]
    tile: tuple[int, int]
    buffers: tuple[Buffer, ...]
    textures: tuple[Texture, ...]
    programs: tuple[Program, ...]
    passes: tuple[Pass, ...]
    uniforms: dict[str, Uniform]
    output: str
    needs: dict[str, int]
    left_out: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse tiles that work groups would overhang into the next tile."""
        for tile, side in zip(self.tile, self.size, strict=True):
            if tile < 1 or (tile < side and tile % GROUP):
                raise PlanError(f"The tile {self.tile} must cover the image or be a multiple of {GROUP} a side.")

    @property
    def shader_sha(self) -> str:
        """One sha256 over all texts."""
        digest = hashlib.sha256()
        for program in self.programs:
            for stage, text in sorted(program.stages.items()):
                digest.update(f"{program.name}/{stage}\n{text}".encode())
        return digest.hexdigest()

    def tracing(self) -> list[tuple[Program, str]]:
        """The programs that trace rays in every frame, each with the stage that does."""
        names = {step.program for step in self.passes if step.phase == "frame" and step.program.startswith("trace")}
        found = [program for program in self.programs if program.name in names]
        return [(program, "compute" if "compute" in program.stages else "fragment") for program in found]

    def save(self, path: Path) -> None:
        """Write the plan to one file."""
        header, blobs = _header(self)
        text = json.dumps(header, sort_keys=True).encode()
        with path.open("wb") as out:
            out.write(MAGIC + struct.pack("<II", VERSION, len(text)) + hashlib.sha256(text).digest() + text)
            for blob in blobs:
                out.write(blob)
                out.write(bytes(-len(blob) % _ALIGN))


def load_plan(path: Path) -> Plan:
    """Read a plan; raise PlanError for another version, a torn file or a buffer that fails its checksum."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise PlanError(f"The plan {path.name} cannot be read.") from error
    if data[:8] != MAGIC or len(data) < HEAD:
        raise PlanError(f"{path.name} is not a RayFarm plan.")
    version, length = struct.unpack_from("<II", data, 8)
    if version != VERSION:
        raise PlanError(f"{path.name} is a plan of version {version}; this host reads version {VERSION}.")
    text = data[HEAD : HEAD + length]
    torn = f"{path.name} is torn: its header cannot be read."
    if len(text) != length or hashlib.sha256(text).digest() != data[16:HEAD]:
        raise PlanError(torn)
    try:
        return _read(json.loads(text), data, HEAD + length)
    except PlanError:
        raise
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, OverflowError, RecursionError) as error:
        raise PlanError(torn) from error  # Whole, and yet no header of a plan.


def _read(header: dict[str, Any], data: bytes, base: int) -> Plan:
    buffers = tuple(_read_buffer(data, base, entry) for entry in header["buffers"])
    return Plan(
        size=_pair(header["size"]),
        tile=_pair(header["tile"]),
        buffers=buffers,
        textures=tuple(_read_texture(data, base, entry) for entry in header["textures"]),
        programs=tuple(_read_program(entry) for entry in header["programs"]),
        passes=tuple(Pass(**entry | {"uniforms": _read_uniforms(entry["uniforms"])}) for entry in header["passes"]),
        uniforms=_read_uniforms(header["uniforms"]),
        output=header["output"],
        needs=header["needs"],
        left_out=tuple(header["left_out"]),
    )


def refuse_beyond(limits: Mapping[str, int], plan: Plan) -> None:
    """Raise PlanError naming the limit, what is needed and what the device has.

    `limits` are the device's by GL name without `GL_MAX_`; one that a host does not know refuses nothing.
    """
    for name, needed in plan.needs.items():
        offered = limits.get(name)
        if offered is not None and needed > offered:
            raise PlanError(f"This device offers GL_MAX_{name} = {offered}; the plan needs {needed}.")


def _header(plan: Plan) -> tuple[dict[str, Any], list[memoryview]]:
    blobs: list[memoryview] = []
    buffers = [{"name": one.name, "bytes": one.nbytes} | _placed(one.data, blobs) for one in plan.buffers]
    textures = [_texture_entry(one) | _placed(one.data, blobs) for one in plan.textures]
    header = {
        "size": plan.size,
        "tile": plan.tile,
        "buffers": buffers,
        "textures": textures,
        "programs": [asdict(program) | {"sha256": _texts_sha(program)} for program in plan.programs],
        "passes": [asdict(step) for step in plan.passes],
        "uniforms": plan.uniforms,
        "output": plan.output,
        "needs": plan.needs,
        "left_out": plan.left_out,
    }
    return header, blobs


def _texture_entry(texture: Texture) -> dict[str, Any]:
    nbytes = None if texture.data is None else texture.data.nbytes
    return {"name": texture.name, "format": texture.format, "width": texture.width, "bytes": nbytes}


def _placed(data: Words | None, blobs: list[memoryview]) -> dict[str, Any]:
    """Put data behind the blobs; its place and sum."""
    if data is None:
        return {"offset": None, "sha256": None}
    offset = sum(len(blob) + -len(blob) % _ALIGN for blob in blobs)
    blobs.append(np.ascontiguousarray(data, "<u4").data.cast("B"))
    return {"offset": offset, "sha256": hashlib.sha256(blobs[-1]).hexdigest()}


def _texts_sha(program: Program) -> dict[str, str]:
    return {stage: hashlib.sha256(text.encode()).hexdigest() for stage, text in program.stages.items()}


def _read_program(entry: dict[str, Any]) -> Program:
    program = Program(entry["name"], entry["stages"])
    if _texts_sha(program) != entry["sha256"]:
        raise PlanError(f"The plan's program {program.name} fails its checksum: the file is torn.")
    return program


def _read_uniforms(entries: dict[str, list[Any]]) -> dict[str, Uniform]:
    return {name: (kind, values) for name, (kind, values) in entries.items()}


def _read_buffer(data: bytes, base: int, entry: dict[str, Any]) -> Buffer:
    return Buffer(entry["name"], entry["bytes"], _read_words(data, base, entry, "buffer"))


def _read_texture(data: bytes, base: int, entry: dict[str, Any]) -> Texture:
    return Texture(entry["name"], entry["format"], entry["width"], _read_words(data, base, entry, "texture"))


def _read_words(data: bytes, base: int, entry: dict[str, Any], kind: str) -> Words | None:
    if entry["offset"] is None:
        return None
    start = base + entry["offset"]
    blob = memoryview(data)[start : start + entry["bytes"]]
    if len(blob) != entry["bytes"] or hashlib.sha256(blob).hexdigest() != entry["sha256"]:
        raise PlanError(f"The plan's {kind} {entry['name']} fails its checksum: the file is torn.")
    return np.frombuffer(blob, "<u4")


def _pair(values: Sequence[int]) -> tuple[int, int]:
    return (int(values[0]), int(values[1]))
