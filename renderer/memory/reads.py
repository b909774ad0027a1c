"""Records what the timed program reads: the words that `shaders/common_reads.glsl` notes, pixel by pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from renderer.host import Host
from renderer.memory.blocks import LANES, Blocks, Ints, choose_blocks, grid_of
from renderer.planner import Reads
from renderer.prepare import Prepared

MOST_BLOCKS = 256
MOST_BYTES = 128 << 20
"""The largest buffer of reads: ES 3.1 promises storage blocks of 128 MiB."""

RAY = 3 << 30
"""The word that stands before a ray's reads; words of reads are smaller."""

Words = npt.NDArray[np.uint32]


@dataclass(frozen=True, eq=False)
class Streams:
    """What the pixels of `blocks` read, each in its order: `words[begin[i, lane]:end[i, lane]]`.

    `begin` and `end` are (n, 64) int64, lanes row by row from a block's bottom left; pixels outside the image read
    nothing. A word holds a read's buffer (bits 30 and 31: nodes with the triangle lists, primitives, normals), its
    number of words less one (bits 28 and 29) and the buffer's word at which it begins; or it is RAY.
    """

    blocks: Blocks
    words: Words
    begin: Ints
    end: Ints


def record_reads(
    prepared: Prepared, host: Host, most_blocks: int = MOST_BLOCKS, most_bytes: int = MOST_BYTES
) -> Streams | None:
    """Run the timed program over a sample of blocks and record its reads; None where one block has too many.

    The first run only counts, so that every pixel gets the room that it needs. Fewer blocks are taken where the reads
    of `most_blocks` do not fit into `most_bytes`.
    """
    while most_blocks > 0:
        blocks = choose_blocks(prepared.request.size, most_blocks)
        counted = np.arange(len(blocks) * LANES + 1)
        counts = _run(prepared, host, blocks, counted).astype(np.int64)
        parts = np.concatenate([[0], np.cumsum(1 + counts)])
        need = int(parts[-1]) * 4
        if need <= most_bytes:
            words = _run(prepared, host, blocks, parts)
            begin = parts[:-1].reshape(-1, LANES) + 1
            return Streams(blocks, words, begin, begin + counts.reshape(-1, LANES))
        most_blocks = min(len(blocks) - 1, len(blocks) * most_bytes // need)
    return None


def _run(prepared: Prepared, host: Host, blocks: Blocks, parts: Ints) -> Words:
    """The buffer of one run; the pixel `lane` of the block `i` has the words from `parts[64 i + lane]` on."""
    columns, rows = grid_of(prepared.request.size)
    table = np.zeros(columns * rows, np.int64)
    table[blocks.index] = len(table) + LANES * np.arange(len(blocks))
    places = np.concatenate([table, parts]).astype(np.uint32)
    ((_, words),) = host.collect(prepared.recording_plan(Reads(places, int(parts[-1]))))
    return words
