"""The agent's record: read when it is whole and this run's own, refused in one sentence otherwise."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from agent_records import AGENT, IMAGE, TILE, TOKEN, blob, header, record, written

from server.devices.agent_record import MAX_HEADER, AgentRecord, FrameTimes, RecordError, read_record


def read(folder: Path, data: bytes) -> AgentRecord:
    return read_record(written(folder, data), TOKEN, AGENT)


def test_a_whole_record_is_read(tmp_path: Path) -> None:
    path = written(tmp_path, record())
    found = read_record(path, TOKEN, AGENT)
    path.unlink()
    assert (found.outcome, found.reason) == ("done", None)
    assert (found.compile_ms, found.upload_ms, found.warm_up_ms) == (12.5, 3.0, 20.25)
    assert found.frames == (FrameTimes(5_000_000_000, None, 4_999_000_000, False),)
    assert [(one.name, one.tile, bytes(one.data)) for one in found.blobs] == [
        ("records", (0, 0, 2, 2), TILE),
        ("image", (0, 0, 4, 4), IMAGE),
    ]
    assert found.device["limits"] == {"COMPUTE_SHADER_STORAGE_BLOCKS": 24}


def test_a_record_torn_anywhere_is_refused(tmp_path: Path) -> None:
    whole = record()
    for length in range(len(whole)):
        with pytest.raises(RecordError, match=r"torn|no record"):
            read(tmp_path, whole[:length])


def test_a_record_with_any_byte_changed_is_refused(tmp_path: Path) -> None:
    whole = record()
    for at in range(len(whole)):
        with pytest.raises(RecordError):
            read(tmp_path, whole[:at] + bytes([whole[at] ^ 0x20]) + whole[at + 1 :])


@pytest.mark.parametrize("added", [b"\0", bytes(64), record()], ids=["a byte", "zeros", "a record"])
def test_a_record_with_something_behind_it_is_refused(tmp_path: Path, added: bytes) -> None:
    with pytest.raises(RecordError, match="torn"):
        read(tmp_path, record() + added)


@pytest.mark.parametrize("token", ["", "5e" * 16, None, 0])
def test_another_run_s_record_is_refused(tmp_path: Path, token: Any) -> None:
    with pytest.raises(RecordError, match="another run"):
        read(tmp_path, record(header(token=token)))


@pytest.mark.parametrize("agent", ["0.1.0+0123456789aa", "", None, "\x1b[31m0.2"])
def test_another_agent_s_record_is_refused(tmp_path: Path, agent: Any) -> None:
    with pytest.raises(RecordError, match="The phone runs agent") as refused:
        read(tmp_path, record(header(agent=agent)))
    assert "\x1b" not in str(refused.value)


def test_another_version_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="version 2; version 1"):
        read(tmp_path, record(version=2))


@pytest.mark.parametrize("length", [1 << 20, MAX_HEADER + 1, 0xFFFFFFFF])
def test_a_header_longer_than_the_record_is_refused(tmp_path: Path, length: int) -> None:
    with pytest.raises(RecordError, match=f"says it has {length} bytes"):
        read(tmp_path, record(length=length))


def test_a_header_longer_than_any_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="says it has"):
        read(tmp_path, record(b" " * (MAX_HEADER + 1)))


@pytest.mark.parametrize(
    "text",
    [b"", b"{", b"\xff\xfe", b"[" * 100_000, b"1" * 10_000, b"[]", b'"x"', b"null"],
    ids=["empty", "open", "no UTF-8", "deep", "huge number", "list", "text", "null"],
)
def test_a_header_that_is_no_object_is_refused(tmp_path: Path, text: bytes) -> None:
    with pytest.raises(RecordError, match="header is"):
        read(tmp_path, record(text))


FRAME = {"wall_ns": 1, "cpu_ns": 1, "gpu_ns": 1, "disjoint": False}
WRONG: dict[str, dict[str, Any]] = {
    "unknown outcome": {"outcome": "perfect"},
    "outcome of another kind": {"outcome": ["done"]},
    "device no object": {"device": []},
    "frames no list": {"frames": {}},
    "frame no object": {"frames": [1]},
    "negative time": {"frames": [FRAME | {"wall_ns": -1}]},
    "frame of no time": {"frames": [FRAME | {"wall_ns": 0}]},
    "time as text": {"frames": [FRAME | {"wall_ns": "1"}]},
    "time as truth": {"frames": [FRAME | {"wall_ns": True}]},
    "time beyond 62 bits": {"frames": [FRAME | {"gpu_ns": 1 << 62}]},
    "no wall time": {"frames": [FRAME | {"wall_ns": None}]},
    "infinite compiling": {"compile_ms": float("inf")},
    "compiling of no number": {"compile_ms": float("nan")},
    "negative compiling": {"compile_ms": -1.0},
    "samples no object": {"samples": [1]},
    "blobs no list": {"blobs": {}},
    "blob no object": {"blobs": ["image"]},
    "blob without a name": {"blobs": [blob("x", IMAGE, 48, (0, 0, 4, 4)) | {"name": 7}]},
    "blob before the blobs": {"blobs": [blob("x", IMAGE, -16, (0, 0, 4, 4))]},
    "blob at an odd place": {"blobs": [blob("x", IMAGE[1:], 49, (0, 0, 4, 4))]},
    "blob past the end": {"blobs": [blob("x", IMAGE, 64, (0, 0, 4, 4))]},
    "blob far past the end": {"blobs": [blob("x", IMAGE, 1 << 60, (0, 0, 4, 4))]},
    "blob larger than all": {"blobs": [blob("x", IMAGE, 48, (0, 0, 4, 4), bytes=1 << 61)]},
    "blob in pieces of pixels": {"blobs": [blob("x", IMAGE, 48, (0, 0, 4, 4), width=1.5)]},
    "blob of another sum": {"blobs": [blob("x", IMAGE, 48, (0, 0, 4, 4), sha256="00" * 32)]},
    "blob without a sum": {"blobs": [blob("x", IMAGE, 48, (0, 0, 4, 4), sha256=None)]},
}


@pytest.mark.parametrize("changes", WRONG.values(), ids=WRONG)
def test_a_header_that_makes_no_sense_is_refused(tmp_path: Path, changes: dict[str, Any]) -> None:
    with pytest.raises(RecordError, match=r"^The agent's record is (not understood|torn): [^\n]*\.$"):
        read(tmp_path, record(header(**changes)))


def test_hostile_words_are_made_plain(tmp_path: Path) -> None:
    reason = "\x1b]0;title\x07no\u202egood\n" + "x" * 10_000_000
    found = read(tmp_path, record(header(outcome="failed", reason=reason)))
    assert found.reason is not None
    assert found.reason.startswith("]0;title no good xxx")
    assert len(found.reason) == 400
    assert found.reason.isprintable()
