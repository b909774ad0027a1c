"""What goes to a phone is from a small alphabet; what comes from one is bounded and plain."""

from __future__ import annotations

import io
import socket
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Thread
from types import SimpleNamespace

import pytest

from renderer.plan import PlanError
from server.devices.adb import client
from server.devices.agent_words import AgentWords
from server.devices.wire import (
    EXIT,
    STDERR,
    STDOUT,
    BrokenError,
    OverdueError,
    RefusedError,
    Wire,
    receive_file,
    send_file,
    shell_output,
)
from server.devices.words import MAX_TEXT, WordError, plain, require_package, require_path, require_serial

HOSTILE = [
    "",
    " ",
    "-s",
    "a b",
    "a;b",
    "$(id)",
    "`id`",
    "a'b",
    'a"b',
    "a\nb",
    "a\0b",
    "é",
    "x" * 5000,
    "a|b",
    "a&b",
    "~",
]


@pytest.mark.parametrize("text", ["R58M123ABC", "127.0.0.1:5555", "emulator-5554", "[fe80::1%wlan0]:5555"])
def test_serials_pass(text: str) -> None:
    assert require_serial(text) == text


def test_an_mdns_serial_passes() -> None:
    require_serial("adb-R58M123ABC-x1Y2z3._adb-tls-connect._tcp")


@pytest.mark.parametrize("text", [*HOSTILE, "a/b"])
def test_what_is_no_serial_is_refused(text: str) -> None:
    with pytest.raises(WordError, match="no phone's serial") as refused:
        require_serial(text)
    assert len(str(refused.value)) < 300


@pytest.mark.parametrize("text", [*HOSTILE, "agent", "1.2", "a..b", "/a"])
def test_what_is_no_package_is_refused(text: str) -> None:
    with pytest.raises(WordError, match="no Android package"):
        require_package(text)


@pytest.mark.parametrize("text", [*HOSTILE, "a/b", "/a/../b", "/..", "/", "//a", "/a/", "/a b", "/a/$(id)"])
def test_what_is_no_path_is_refused(text: str) -> None:
    with pytest.raises(WordError, match="no path"):
        require_path(text)


def test_paths_of_counters_pass() -> None:
    require_path("/sys/class/devfreq/13000000.mali/cur_freq")


@pytest.mark.parametrize("port", ["", "0", "65536", "tcp:1", "-1", "5037x"])
def test_a_port_that_is_none_is_refused(monkeypatch: pytest.MonkeyPatch, port: str) -> None:
    monkeypatch.setenv("ANDROID_ADB_SERVER_PORT", port)
    with pytest.raises(PlanError, match="ANDROID_ADB_SERVER_PORT is"):
        client()


def test_plain_text_is_one_short_printable_line() -> None:
    said = b"\x1b[31m<b>A\r\n\tB\xff\x00\xe2\x80\xae\xe2\x80\xa8C</b>" + b"x" * 1_000_000
    text = plain(said)
    assert text.startswith("[31m<b>A B\N{REPLACEMENT CHARACTER} C</b>x")
    assert text.isprintable()
    assert len(text) == MAX_TEXT


def test_phases_are_heard_in_any_pieces() -> None:
    words = AgentWords()
    for byte in b"rayfarm ready\nrayfarm fra\nrayfarm frame 12\nrayfarm frame":
        words.hear(STDOUT, bytes([byte]))
    assert words.phase == "frame 12"


@pytest.mark.parametrize(
    "line", [b"rayfarm frame 99999999", b"rayfarm <b>", b" rayfarm done", b"x" * 10**6 + b"rayfarm done"]
)
def test_other_lines_are_not_phases(line: bytes) -> None:
    words = AgentWords()
    words.hear(STDOUT, line[:500_000])
    words.hear(STDOUT, line[500_000:] + b"\n")
    assert words.phase == "nothing"


def test_the_last_error_is_short_and_plain() -> None:
    words = AgentWords()
    for _ in range(50):
        words.hear(STDERR, b"noise" * 10_000)
    words.hear(STDERR, b"\nout of \x1b[1mmemory\n\n")
    assert words.last_error == "out of [1mmemory"


@contextmanager
def answering(*answers: bytes, patience_s: float = 5.0, close: bool = True) -> Iterator[Wire]:
    """A wire whose other end says this, whatever it is told."""
    near, far = socket.socketpair()

    def speak() -> None:
        try:
            for answer in answers:
                far.sendall(answer)
            if close:
                far.shutdown(socket.SHUT_WR)
            while far.recv(1 << 16):
                pass
        except OSError:
            pass

    thread = Thread(target=speak)
    thread.start()
    try:
        yield Wire(SimpleNamespace(conn=near), patience_s)
    finally:
        near.close()
        thread.join()
        far.close()


def packet(kind: int, data: bytes) -> bytes:
    return struct.pack("<BI", kind, len(data)) + data


def test_a_shell_is_read_to_its_exit() -> None:
    said = packet(STDOUT, b"x" * 200_000) + packet(STDERR, b"") + packet(9, b"?") + packet(EXIT, b"\7")
    with answering(said) as wire:
        pieces = list(shell_output(wire))
    assert b"".join(piece for kind, piece in pieces if kind == STDOUT) == b"x" * 200_000
    assert pieces[-1] == (EXIT, b"\7")


@pytest.mark.parametrize("length", range(12))
def test_a_shell_that_breaks_off_never_ends_well(length: int) -> None:
    said = packet(STDOUT, b"x") + packet(EXIT, b"\0")
    with answering(said[:length]) as wire, pytest.raises(BrokenError, match=r"^the connection ended$"):
        list(shell_output(wire))


def test_a_packet_of_gigabytes_is_read_in_pieces() -> None:
    with answering(struct.pack("<BI", STDOUT, 0xFFFFFFFF), b"x" * (3 << 20)) as wire:
        sizes: list[int] = []
        with pytest.raises(BrokenError):
            sizes.extend(len(piece) for _, piece in shell_output(wire))
        assert sum(sizes) == 3 << 20
        assert max(sizes) <= 1 << 16


def test_silence_and_lateness_are_told_apart() -> None:
    with (
        answering(close=False, patience_s=0.05) as wire,
        pytest.raises(BrokenError, match="nothing was heard") as silent,
    ):
        wire.read(1)
    assert not isinstance(silent.value, OverdueError)
    with answering(close=False) as wire:
        wire.until = 0.0
        with pytest.raises(OverdueError):
            wire.read(1)


FAIL = b"FAIL" + struct.pack("<I", 9) + b"No\nspace!"
Act = Callable[[Wire], object]


def pull(wire: Wire) -> object:
    return receive_file(wire, "/a", io.BytesIO(), 100)


def push(wire: Wire) -> object:
    send_file(wire, io.BytesIO(bytes(100_000)), "/a")
    return None


@pytest.mark.parametrize("act", [pull, push])
def test_a_refusal_is_told_in_the_phone_s_words_made_plain(act: Act) -> None:
    with answering(FAIL) as wire, pytest.raises(RefusedError, match=r"^No space!$"):
        act(wire)


@pytest.mark.parametrize("act", [pull, push])
@pytest.mark.parametrize("answer", [b"WHAT\0\0\0\0", b"\0" * 8])
def test_an_answer_beside_the_protocol_is_refused(act: Act, answer: bytes) -> None:
    with answering(answer) as wire, pytest.raises(RefusedError, match="protocol"):
        act(wire)


@pytest.mark.parametrize("act", [pull, push])
@pytest.mark.parametrize("answer", [b"", b"FA", FAIL[:-1]])
def test_an_answer_that_breaks_off_is_a_phone_gone(act: Act, answer: bytes) -> None:
    with answering(answer) as wire, pytest.raises(BrokenError):
        act(wire)


def test_a_file_larger_than_asked_for_is_refused_before_it_is_read() -> None:
    kept = io.BytesIO()
    with answering(b"DATA" + struct.pack("<I", 0xFFFFFFFF)) as wire, pytest.raises(RefusedError, match="larger than"):
        receive_file(wire, "/a", kept, 100)
    assert kept.getvalue() == b""
