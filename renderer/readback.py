"""Turns the record buffer of an instrumented plan into `Records` (the layout is in `shaders/common_records.glsl`)."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from renderer.records import RASTERISED, Hits, Rays, Records

Words = npt.NDArray[np.uint32]
Tile = tuple[int, int, int, int]

_SEEN = 0xFFFFFFFE
_MISS = 0xFFFFFFFF


def read_records(
    size: tuple[int, int],
    tile: tuple[int, int],
    lights: int,
    tiles: Iterable[tuple[Tile, Words]],
    *,
    rasterised: bool = False,
) -> Records:
    """Gather the tiles of one image; `tile` is the plan's tile size, the row pitch of each tile's buffer."""
    width, height = size
    image = np.zeros((height, width, 1 + lights, 4, 4), np.uint32)
    for (x, y, across, down), words in tiles:
        part = words.reshape(tile[1], tile[0], 1 + lights, 4, 4)
        image[y : y + down, x : x + across] = part[:down, :across]
    pixels = image.reshape(width * height, 1 + lights, 4, 4)
    primary, shadow = pixels[:, 0], pixels[:, 1:]
    cast = (shadow[:, :, 1, 3] & 1) == 1
    pixel, light = np.nonzero(cast)
    shadow = shadow[cast]
    found = primary[:, 1, 3]
    missed = found == _MISS
    primitive = np.where(missed, -1, np.where(found == _SEEN, RASTERISED, found.astype(np.int64)))
    reach = np.full(len(pixels), np.finfo(np.float32).max, np.float32)
    return Records(
        size=size,
        primary=Rays(_floats(primary[:, 0, :3]), _floats(primary[:, 1, :3]), reach),
        hits=Hits(
            t=np.where(missed, np.float32(np.inf), _floats(primary[:, 0, 3])),
            primitive=primitive.astype(np.int32),
        ),
        shadow=Rays(_floats(shadow[:, 0, :3]), _floats(shadow[:, 1, :3]), _floats(shadow[:, 0, 3])),
        shadow_pixel=pixel.astype(np.int32),
        shadow_light=light.astype(np.int32),
        occluded=(shadow[:, 1, 3] & 2) != 0,
        primary_counts=_counts(primary),
        shadow_counts=_counts(shadow),
        cut=primary[:, 3, 1] != 0,
        rasterised=rasterised,
    )


def _floats(words: Words) -> npt.NDArray[np.float32]:
    return np.ascontiguousarray(words).view(np.float32)


def _counts(chunks: Words) -> Words:
    return np.concatenate([chunks[:, 2], chunks[:, 3, :1]], axis=1)
