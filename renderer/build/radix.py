"""A stable radix sort of float32 keys, several times faster here than numpy's stable argsort."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.jit import jit

Words = npt.NDArray[np.uint32]

DIGIT_BITS = 11
DIGITS = 3
BUCKETS = 1 << DIGIT_BITS
DIGIT_MASK = np.uint32(BUCKETS - 1)


@jit
def sort_keys(values: npt.NDArray[np.float32]) -> Words:
    """uint32 keys in the order of the float32 `values`; -0 and +0 get the same key."""
    whole = np.empty(len(values), np.float32)
    for i in range(len(values)):
        whole[i] = values[i] + np.float32(0)
    bits, keys = whole.view(np.uint32), np.empty(len(values), np.uint32)
    for i in range(len(values)):
        keys[i] = bits[i] ^ (np.uint32(0xFFFFFFFF) if bits[i] >> np.uint32(31) else np.uint32(0x80000000))
    return keys


@jit
def stable_order(keys: Words) -> Words:
    """The permutation (m,) uint32 that sorts `keys` (m,) uint32 ascending; equal keys keep their order."""
    counts = _first_slots(keys)
    source = keys.copy()
    target = np.empty_like(keys)
    order = np.arange(keys.size).astype(np.uint32)
    moved = np.empty_like(order)
    for digit in range(DIGITS):
        _scatter(source, order, target, moved, counts[digit], np.uint32(DIGIT_BITS * digit))
        source, target = target, source
        order, moved = moved, order
    return order


@jit
def _first_slots(keys: Words) -> npt.NDArray[np.int64]:
    """For every digit and bucket the slot of the first key that falls in it."""
    slots = np.zeros((DIGITS, BUCKETS), np.int64)
    for key in keys:
        for digit in range(DIGITS):
            slots[digit, (key >> np.uint32(DIGIT_BITS * digit)) & DIGIT_MASK] += 1
    for digit in range(DIGITS):
        before = 0
        for bucket in range(BUCKETS):
            inside = slots[digit, bucket]
            slots[digit, bucket] = before
            before += inside
    return slots


@jit
def _scatter(
    source: Words, order: Words, target: Words, moved: Words, slots: npt.NDArray[np.int64], shift: np.uint32
) -> None:
    for i in range(source.size):
        bucket = (source[i] >> shift) & DIGIT_MASK
        slot = np.uint64(slots[bucket])
        slots[bucket] += 1
        target[slot] = source[i]
        moved[slot] = order[i]
