"""Thousands of changed plan files, from a seed, read by the agent in one process and by Python: refused alike, or read.

A changed byte is refused by both. A header that is whole and yet makes no sense, which no damage gives, may be refused
by one alone; neither falls over it.
"""

from __future__ import annotations

import copy
import hashlib
import json
import random
import struct
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from agent_desktop import Batch

from renderer.plan import HEAD, MAGIC, VERSION, PlanError, load_plan

GOLDEN = (Path(__file__).parent.parent / "fixtures" / "plan_v3.bin").read_bytes()
SEED = 20_260_101
DAMAGED, SENSELESS = 2500, 2500
ODD: list[Any] = [
    None, True, "", "x", "\0", -1, 0, 1, 2**31, 2**63, 2**70, -(2**70), 1e308, 0.5, [], {}, [[]], {"a": 1}, [1, 2], "1",
]  # fmt: skip
PIECES = (b"", b"\0", b"\xff" * 4, b'"', b"{", b"}", b"[" * 200, b"null", b"1e999", b"\xed\xa0\x80", b"-1", MAGIC)


@pytest.fixture(scope="module")
def agent() -> Iterator[Batch]:
    with Batch() as batch:
        yield batch


def test_a_damaged_file_is_refused_by_both_or_read_by_both(agent: Batch, tmp_path: Path) -> None:
    rng, seen = random.Random(SEED), Counter[str]()
    for _ in range(DAMAGED):
        ours, theirs = read_both(agent, tmp_path / "plan", damaged(rng))
        assert (ours is None) == (theirs is None), (ours, theirs)
        seen["read" if ours is None else "refused"] += 1
    print(f"seed {SEED}: {dict(seen)}")
    assert seen["refused"] > DAMAGED / 2
    assert seen["read"] > 0, "a byte between two buffers is nobody's"


def test_a_header_without_sense_makes_neither_fall_over(agent: Batch, tmp_path: Path) -> None:
    rng, seen = random.Random(SEED), Counter[str]()
    for _ in range(SENSELESS):
        ours, theirs = read_both(agent, tmp_path / "plan", senseless(rng))
        seen["alike" if (ours is None) == (theirs is None) else "refused by one"] += 1
    print(f"seed {SEED}: {dict(seen)}")
    assert seen["alike"] > SENSELESS / 2


def read_both(agent: Batch, path: Path, data: bytes) -> tuple[str | None, str | None]:
    """What Python and the agent say of a file; None where they read it."""
    path.write_bytes(data)
    try:
        load_plan(path)
        ours = None
    except PlanError as error:
        ours = str(error)
        assert ours.endswith(".")
    answer = agent.ask({"plan": str(path)})
    # JSON has no infinity: a uniform that became one is read, and shown as null.
    assert answer == "null" or answer.startswith(("{", "error ")), (answer, data[:HEAD], len(data))
    theirs = answer.removeprefix("error ") if answer.startswith("error ") else None
    assert theirs is None or theirs.endswith("."), theirs
    return ours, theirs


def damaged(rng: random.Random) -> bytes:
    """The pinned plan with a few bytes changed, cut out or put in, or cut off."""
    data = bytearray(GOLDEN)
    for _ in range(rng.choice((1, 1, 1, 2, 5))):
        at = rng.choice((rng.randrange(HEAD), rng.randrange(len(data) + 1), rng.randrange(len(data) + 1)))
        kind = rng.randrange(4)
        if kind == 0 and at < len(data):
            data[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            data[at : at + rng.randrange(40)] = rng.choice(PIECES)
        elif kind == 2:
            data[at:at] = rng.choice(PIECES)
        else:
            del data[max(at, rng.randrange(len(data) + 1)) :]
    return bytes(data)


def senseless(rng: random.Random) -> bytes:
    """The pinned plan with parts of its header replaced or left out, and the checksum made right again."""
    (length,) = struct.unpack_from("<I", GOLDEN, 12)
    header = copy.deepcopy(json.loads(GOLDEN[HEAD : HEAD + length]))
    for _ in range(rng.choice((1, 1, 2))):
        change(rng, header)
    text = json.dumps(header).encode()
    if rng.random() < 0.1:
        text = text[: rng.randrange(len(text))] + rng.choice(PIECES) + text[rng.randrange(len(text)) :]
    head = MAGIC + struct.pack("<II", VERSION, len(text)) + hashlib.sha256(text).digest()
    return head + text + GOLDEN[HEAD + length :]


def change(rng: random.Random, value: Any) -> None:
    """Replace, or leave out, something at random below a value."""
    keys = list(value) if isinstance(value, dict) else list(range(len(value)))
    if not keys:
        return
    key = rng.choice(keys)
    if isinstance(value[key], dict | list) and value[key] and rng.random() < 0.8:
        change(rng, value[key])
    elif rng.random() < 0.2:
        del value[key]
    else:
        value[key] = copy.deepcopy(rng.choice(ODD))
