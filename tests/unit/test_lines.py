"""The memory model: the replay against a plain one, figures worked out by hand, and the sample of blocks."""

from __future__ import annotations

from collections import OrderedDict
from itertools import groupby, pairwise

import numpy as np
import pytest

from renderer.memory.blocks import LANES, Blocks, choose_blocks, grid_of
from renderer.memory.lines import CACHE_LINES, lines_of, replay
from renderer.memory.reads import RAY, Streams

NODES, PRIMITIVES = 0, 1
Lane = list[int]


def read(source: int, word: int, words: int = 4) -> int:
    """A read as the shader notes it."""
    return source << 30 | words - 1 << 28 | word


def streams(blocks: list[list[Lane]], weight: list[int] | None = None) -> Streams:
    """Streams of these blocks, each with the words of up to 64 lanes; something lies between any two lanes."""
    lanes = [lane for block in blocks for lane in [*block, *[[]] * (LANES - len(block))]]
    ends = np.cumsum([1 + len(lane) for lane in lanes])
    words = np.concatenate([np.array([len(lane), *lane], np.uint32) for lane in lanes])
    begin = ends - [len(lane) for lane in lanes]
    weights = np.array(weight or [1] * len(blocks))
    shape = (-1, LANES)
    return Streams(Blocks(np.arange(len(blocks)), weights), words, begin.reshape(shape), ends.reshape(shape))


def plain_fills(block: list[Lane], cache_lines: int) -> int:
    """Lockstep and the least recently used line, each the obvious way."""
    rays = [[list(part) for mark, part in groupby(lane, lambda word: word == RAY) if not mark] for lane in block]
    assert all(lane[0] == RAY and (RAY, RAY) not in pairwise(lane) for lane in block if lane)
    cache: OrderedDict[tuple[int, int], None] = OrderedDict()
    fills = 0
    for nth in range(max(map(len, rays))):
        parts = [lane[nth] for lane in rays if nth < len(lane)]
        for step in range(max(map(len, parts))):
            for word in [part[step] for part in parts if step < len(part)]:
                line = (word >> 30, (word & 0x0FFFFFFF) * 4 // 64)
                fills += line not in cache
                cache[line] = None
                cache.move_to_end(line)
                if len(cache) > cache_lines:
                    cache.popitem(last=False)
    return fills


def random_block(seed: int) -> list[Lane]:
    """Lanes of up to three rays, whose reads return to a few places now and then; some lanes read nothing."""
    rng = np.random.default_rng(seed)
    lanes: list[Lane] = []
    for _ in range(LANES):
        lane: Lane = []
        for _ in range(rng.integers(0, 4)):
            near = rng.integers(0, 1 << 24) * (rng.random() < 0.3)
            reads = [
                read(int(rng.integers(0, 3)), int(near + rng.integers(0, 4096)), int(rng.integers(1, 5)))
                for _ in range(rng.integers(1, 60))
            ]
            lane += [RAY, *reads]
        lanes.append(lane)
    return lanes


@pytest.mark.parametrize("cache_lines", [1, 2, 7, 64, CACHE_LINES, 4096])
@pytest.mark.parametrize("seed", [81, 82])
def test_the_replay_is_that_of_a_plain_cache(seed: int, cache_lines: int) -> None:
    blocks: list[list[Lane]] = [random_block(seed), random_block(seed + 100), [[]]]
    made = streams(blocks)
    fills, rays = replay(made.words, made.begin, made.end, cache_lines)
    assert fills.tolist() == [*(plain_fills(block, cache_lines) for block in blocks[:2]), 0]
    assert rays.tolist() == [sum(lane.count(RAY) for lane in block) for block in blocks]


@pytest.mark.parametrize(
    ("lane", "fills"),
    [
        ([RAY, read(NODES, 0), read(NODES, 4), read(NODES, 12), read(NODES, 15, 1)], 1),
        ([RAY, read(NODES, 12), read(NODES, 16)], 2),
        ([RAY, read(NODES, 0), read(PRIMITIVES, 0)], 2),
        ([RAY, *(read(NODES, 16 * i) for i in range(CACHE_LINES)), read(NODES, 0)], CACHE_LINES),
        ([RAY, *(read(NODES, 16 * i) for i in range(CACHE_LINES + 1)), read(NODES, 0)], CACHE_LINES + 2),
        ([RAY, read(NODES, (1 << 28) - 4), read(PRIMITIVES, (1 << 28) - 4), RAY, read(PRIMITIVES, (1 << 28) - 1)], 2),
    ],
    ids=["one line", "two lines", "two buffers", "just fits", "one too many", "last words"],
)
def test_lines_by_hand(lane: Lane, fills: int) -> None:
    made = streams([[lane]])
    assert replay(made.words, made.begin, made.end, CACHE_LINES)[0].tolist() == [fills]


def test_a_wave_reads_in_lockstep() -> None:
    """Alone, each lane would find its second read's line pushed out by its first two; together they share them."""
    lane = [RAY, read(NODES, 0), read(NODES, 16), read(NODES, 0)]
    together, apart = streams([[lane] * LANES]), streams([[lane]] * LANES)
    assert replay(together.words, together.begin, together.end, 1)[0].sum() == 3
    assert replay(apart.words, apart.begin, apart.end, 1)[0].sum() == 3 * LANES


def test_pixels_wait_for_each_other_before_the_next_ray() -> None:
    """The second rays' one line is read by both lanes at once, though the first lane's first ray is shorter."""
    short, long = [RAY, read(NODES, 0)], [RAY, *(read(NODES, 16 * i) for i in range(5))]
    second = [RAY, read(NODES, 1600)]
    made = streams([[short + second, long + second]])
    assert replay(made.words, made.begin, made.end, 1)[0].tolist() == [6]


def test_a_block_counts_for_those_it_stands_for() -> None:
    one, two = [[RAY, read(NODES, 0)]], [[RAY, read(NODES, 0), read(NODES, 16), RAY, read(NODES, 32)]]
    lines = lines_of(streams([one, two], [3, 1]))
    assert lines.per_ray == pytest.approx((3 * 1 + 1 * 3) / (3 * 1 + 1 * 2))
    assert lines.rays == 3
    assert lines.as_dict() | {"text": ""} == {
        "line_bytes": 64,
        "cache_lines": CACHE_LINES,
        "block": [8, 8],
        "rays": 3,
        "text": "",
    }
    assert lines.text.startswith("A model: ")


def test_without_rays_there_is_no_figure() -> None:
    lines = lines_of(streams([[[read(NODES, 0)]], [[]]]))
    assert (lines.per_ray, lines.rays) == (None, 0)
    assert lines.text.startswith("Not modelled: ")


@pytest.mark.parametrize("size", [(8, 8), (1, 1), (150, 70), (1024, 1024), (4096, 9), (1000, 700)], ids=str)
@pytest.mark.parametrize("most", [1, 100, 256])
def test_a_sample_stands_for_the_whole_image(size: tuple[int, int], most: int) -> None:
    columns, rows = grid_of(size)
    blocks = choose_blocks(size, most)
    assert len(blocks) == min(most, columns * rows)
    assert len(np.unique(blocks.index)) == len(blocks)
    assert blocks.weight.sum() == columns * rows
    assert 0 <= blocks.weight.max() - blocks.weight.min() <= 1
    assert blocks.index.min() >= 0
    assert blocks.index.max() < columns * rows
    np.testing.assert_array_equal(choose_blocks(size, most).index, blocks.index)


def test_a_sample_is_spread_over_the_image() -> None:
    """256 of 128x128 blocks: one in every 8x8 of them."""
    blocks = choose_blocks((1024, 1024), 256)
    patches = (blocks.index % 128 // 8) + 16 * (blocks.index // 128 // 8)
    assert sorted(patches.tolist()) == list(range(256))
