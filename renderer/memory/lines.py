"""The memory model: recorded reads replayed through a small cache, and the lines that it fetched.

A block of 8x8 pixels runs as one wave: the k-th reads of its pixels' n-th rays happen together, pixel by pixel, and
every pixel waits for the last before the next ray. Each block begins with an empty cache of its own, fully associative
with the least recently used line going first. Every buffer begins on a line of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from renderer.host import Host
from renderer.jit import jit
from renderer.memory.blocks import SIDE, Ints
from renderer.memory.reads import RAY, Streams, Words, record_reads
from renderer.planner import in_passes
from renderer.prepare import Prepared
from renderer.variant import TRAVERSALS

LINE_BYTES = 64
"""Bytes of a line, as in Mali GPUs (Arm, Mali Bifrost and Valhall OpenCL Developer Guide, 7.3.2)."""

CACHE_LINES = 256
"""Lines that the cache holds: 16 KiB, the order of a phone GPU's first-level cache, here one wave's own."""

_LINE_SHIFT = 4
"""From a word's index to its line's: 16 words of 4 bytes."""


@dataclass(frozen=True)
class Lines:
    """The model's figure: `per_ray` lines fetched over `rays` sampled rays, None with `text` saying why."""

    per_ray: float | None
    rays: int
    text: str

    def as_dict(self) -> dict[str, object]:
        """The result's `model.lines`."""
        model = {"line_bytes": LINE_BYTES, "cache_lines": CACHE_LINES, "block": [SIDE, SIDE]}
        return model | {"rays": self.rays, "text": self.text}


def model_lines(prepared: Prepared, host: Host) -> Lines:
    """Record the reads of the timed program on `host` and replay them."""
    if in_passes(prepared.scene, prepared.tree):
        return Lines(None, 0, "Not modelled: brute force runs in passes here, whose reads are not recorded.")
    if TRAVERSALS[prepared.request.variant.traversal].packet:
        return Lines(None, 0, "Not modelled: the pixels of a packet share its reads.")
    if prepared.request.variant.fetch != "storage":
        return Lines(None, 0, "Not modelled: how the texels of a texture lie in memory is the driver's.")
    if host.device()["kind"] != "twin":
        return Lines(None, 0, "Not modelled: reads are recorded on llvmpipe only; import a profile for a phone's.")
    streams = record_reads(prepared, host)
    if streams is None:
        return Lines(None, 0, "Not modelled: the reads of a single block of 8x8 pixels take more than 128 MiB.")
    return lines_of(streams)


def lines_of(streams: Streams) -> Lines:
    """Replay recorded reads; a block counts for those that it stands for."""
    fills, rays = replay(streams.words, streams.begin, streams.end, CACHE_LINES)
    sampled = int(rays.sum())
    if sampled == 0:
        return Lines(None, 0, "Not modelled: none of the sampled pixels casts a ray that is timed.")
    per_ray = float(streams.blocks.weight @ fills) / float(streams.blocks.weight @ rays)
    return Lines(per_ray, sampled, _text(len(streams.blocks), sampled))


def _text(blocks: int, rays: int) -> str:
    return (
        f"A model: {LINE_BYTES}-byte lines fetched for each ray when the recorded reads of nodes and primitives of "
        f"{blocks} blocks of {SIDE}x{SIDE} pixels ({rays:,} rays) are replayed, each block in lockstep, through an LRU "
        f"cache of {CACHE_LINES} lines that begins empty."
    )


@jit
def replay(words: Words, begin: Ints, end: Ints, cache_lines: int) -> tuple[Ints, Ints]:
    """The lines fetched, and the rays, of each block (n,) of streams as `Streams` holds them."""
    blocks, lanes = begin.shape
    fills, rays = np.zeros(blocks, np.int64), np.zeros(blocks, np.int64)
    recent = np.empty(cache_lines, np.int64)
    for block in range(blocks):
        at, last = begin[block].copy(), end[block]
        held = 0
        while (at < last).any():
            reading = True
            while reading:
                reading = False
                for lane in range(lanes):
                    if at[lane] < last[lane] and words[at[lane]] < RAY:
                        missed = _touch(recent, held, _line_of(int(words[at[lane]])))
                        fills[block] += missed
                        held = min(held + missed, cache_lines)
                        at[lane] += 1
                        reading = True
            for lane in range(lanes):
                rays[block] += at[lane] < last[lane]
                at[lane] += 1
    return fills, rays


@jit
def _line_of(word: int) -> int:
    """The line of a read, told apart from other buffers' lines; no read crosses from one line to the next."""
    return (word >> 30 << 28 | word & 0x0FFFFFFF) >> _LINE_SHIFT


@jit
def _touch(recent: npt.NDArray[np.int64], held: int, line: int) -> int:
    """Put a line in front of the `held` most recent ones; 1 if it was not among them."""
    at = 0
    while at < held and recent[at] != line:
        at += 1
    missed = 1 if at == held else 0
    for i in range(min(at, len(recent) - 1), 0, -1):
        recent[i] = recent[i - 1]
    recent[0] = line
    return missed
