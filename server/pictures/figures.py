"""The figures of one picture and of a pair. What is stored never changes, so each is worked out once a process."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any, cast

import numpy as np

from renderer.pictures.files import PictureError
from server.pictures.stored import Counts, Pixels, read_counts, read_image
from server.store.blobs import Blobs

ROWS = 256
"""Rows of two pictures that are compared at once: a few megabytes of them."""
TOP_PERCENTILE = 99.5
"""What a scale holds of each map's pixels; `renderer.pictures.heatmap_picture.common_scale` takes the same."""


@dataclass(frozen=True)
class CountFigures:
    """The counts of one picture: its size in pixels, figures per pixel, and `high`, which a scale must hold."""

    size: tuple[int, int]
    mean: float
    p50: float
    p99: float
    max: int
    high: float


@dataclass(frozen=True)
class ImagePair:
    """How two images differ: the share of pixels, the largest difference of a channel in 255, PSNR in dB.

    `psnr_db` is None where they are identical, for there is no error to hold the signal against.
    """

    size: tuple[int, int]
    differing: float
    largest: int
    psnr_db: float | None


@dataclass(frozen=True)
class CountPair:
    """How the counts of two pictures differ: the share of pixels, the largest difference, and what a scale must hold.

    `ratio` is the second's mean over the first's, None where that is 0.
    """

    size: tuple[int, int]
    differing: float
    largest: int
    ratio: float | None
    high: float


@lru_cache(4096)
def count_figures(blobs: Blobs, sha256: str, metric: str) -> CountFigures:
    """The figures of one count of a picture."""
    counts = read_counts(blobs, sha256, metric)
    p50, p99, high = (float(value) for value in np.percentile(counts, [50, 99, TOP_PERCENTILE]))
    return CountFigures(size_of(counts), float(counts.mean()), p50, p99, int(counts.max()), high)


@lru_cache(1024)
def image_pair(blobs: Blobs, baseline: str, against: str) -> ImagePair:
    """How two images differ; raise PictureError when their sizes do."""
    one, other = read_image(blobs, baseline), read_image(blobs, against)
    require_same_size(one, other)
    differing, largest, square = 0, 0, 0
    for rows in blocks(one):
        apart = image_difference(one[rows], other[rows])
        differing += int(apart.any(axis=-1).sum())
        largest = max(largest, int(apart.max()))
        square += int(np.square(apart, dtype=np.uint64).sum())
    psnr = 10 * math.log10(255**2 * one.size / square) if square else None
    return ImagePair(size_of(one), differing / (one.size // 3), largest, psnr)


@lru_cache(1024)
def count_pair(blobs: Blobs, baseline: str, against: str, metric: str) -> CountPair:
    """How one count of two pictures differs; raise PictureError when their sizes do."""
    one, other = read_counts(blobs, baseline, metric), read_counts(blobs, against, metric)
    require_same_size(one, other)
    apart = np.maximum(one, other) - np.minimum(one, other)
    mean = float(one.mean())
    ratio = float(other.mean()) / mean if mean else None
    high = float(np.percentile(apart, TOP_PERCENTILE))
    return CountPair(size_of(one), float((apart != 0).mean()), int(apart.max()), ratio, high)


def scale_top(*highs: float) -> int:
    """The top of a scale that pictures share, as `rayfarm heatmap` chooses it."""
    from renderer.pictures.heatmap_picture import common_scale

    return common_scale([cast(Any, np.array(highs[i : i + 1])) for i in range(len(highs))])


def image_difference(one: Pixels, other: Pixels) -> Pixels:
    """The absolute difference per channel."""
    return np.maximum(one, other) - np.minimum(one, other)


def require_same_size(one: Pixels | Counts, other: Pixels | Counts) -> None:
    """Raise PictureError where two pictures cannot be laid over each other."""
    if one.shape[:2] != other.shape[:2]:
        sizes = " and ".join("x".join(map(str, size_of(each))) for each in (one, other))
        raise PictureError(f"The pictures are of {sizes} pixels: choose two of one size.")


def size_of(picture: Pixels | Counts) -> tuple[int, int]:
    """Width and height."""
    return picture.shape[1], picture.shape[0]


def blocks(picture: Pixels | Counts) -> list[slice]:
    """A picture's rows, ROWS at a time."""
    edges = [*range(0, len(picture), ROWS), len(picture)]
    return [slice(start, end) for start, end in pairwise(edges)]
