"""Arrays that grow inside compiled code; plain loops, because numba compiles slice assignment for seconds."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
import numpy.typing as npt

from renderer.jit import jit

Scalar = TypeVar("Scalar", np.float32, np.int32, np.uint32, np.uint8, np.int64)


@jit
def resized(values: npt.NDArray[Scalar], room: int) -> npt.NDArray[Scalar]:
    """A copy of `values` (n,) with `room` entries: cut off, or with undefined ones at the end."""
    copy = np.empty(room, values.dtype)
    for i in range(min(room, len(values))):
        copy[i] = values[i]
    return copy


@jit
def resized_rows(values: npt.NDArray[Scalar], room: int) -> npt.NDArray[Scalar]:
    """`resized` for (n, k): `room` rows."""
    copy = np.empty((room, values.shape[1]), values.dtype)
    for i in range(min(room, len(values))):
        for j in range(values.shape[1]):
            copy[i, j] = values[i, j]
    return copy


@jit
def resized_columns(values: npt.NDArray[Scalar], room: int) -> npt.NDArray[Scalar]:
    """`resized` for (k, n): `room` columns."""
    copy = np.empty((values.shape[0], room), values.dtype)
    for j in range(values.shape[0]):
        for i in range(min(room, values.shape[1])):
            copy[j, i] = values[j, i]
    return copy
