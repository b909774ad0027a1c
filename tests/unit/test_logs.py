"""Logs: one JSON object a line or plain text, with what they are about, and never a secret."""

from __future__ import annotations

import asyncio
import io
import json
import logging
import subprocess
import sys
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from server import logs
from server.logs import about, facts

TOKEN = "0123456789ab." + "s3cret_-" * 5 + "abc"
SECRETS = [
    (f"got {TOKEN} from a page", TOKEN[13:]),
    ("Authorization: Bearer hunter2hunter2", "hunter2hunter2"),
    ("connect postgresql://me:p4ss/word@host/db failed", "p4ss/word"),
    ("postgresql://host/db?user=me&password=p4ssword&x=1", "p4ssword"),
    ("the variable's value opensesame", "opensesame"),
]


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture(autouse=True)
def restored(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """`logs.start` changes the whole process."""
    root = logging.getLogger()
    before = root.handlers[:], root.level, sys.excepthook, threading.excepthook
    root.handlers[:] = []  # pytest's own would be closed.
    yield
    logging.captureWarnings(False)
    root.handlers[:], level, sys.excepthook, threading.excepthook = before
    root.setLevel(level)
    logging.getLogger("rayfarm").setLevel(logging.NOTSET)


def lines(stream: io.StringIO) -> list[dict[str, Any]]:
    return [json.loads(line) for line in stream.getvalue().splitlines()]


def test_an_event_is_one_json_line_about_its_job() -> None:
    stream = io.StringIO()
    logs.start(stream=stream)
    log = logging.getLogger("rayfarm.worker")

    async def work() -> None:
        await asyncio.to_thread(log.info, "in a thread\nof two lines \x1b[2J \u202e")

    with about(job=7, slice=9):
        log.info("taken", extra=facts(device="llvmpipe", nothing=None))
        asyncio.run(work())
    log.debug("not wanted")
    logging.getLogger("httpx").info("not wanted either")
    try:
        raise ValueError("wrong")
    except ValueError:
        log.exception("failed")
    taken, within, failed = lines(stream)
    named = {"job": 7, "slice": 9, "device": "llvmpipe"}
    assert taken.pop("time").endswith("+00:00")
    assert taken == {"level": "info", "logger": "rayfarm.worker", "what": "taken"} | named
    assert (within["job"], within["what"]) == (7, "in a thread\nof two lines \x1b[2J \u202e")
    assert failed["level"] == "error"
    assert failed["error"].splitlines()[-1] == "ValueError: wrong"
    assert "job" not in failed
    assert stream.getvalue().isascii()


def test_a_terminal_gets_plain_lines() -> None:
    stream = Terminal()
    logs.start("warning", stream=stream)
    logging.getLogger("rayfarm").info("not wanted")
    with about(job=7):
        logging.getLogger("rayfarm").warning("hot \x1b[2J", extra=facts(device="R5"))
    assert stream.getvalue()[8:] == " warning: hot ?[2J (job 7, device R5)\n"


@pytest.mark.parametrize("form", ["json", "text"])
@pytest.mark.parametrize(("text", "secret"), SECRETS)
def test_a_secret_is_never_written(form: logs.Form, text: str, secret: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "opensesame")
    stream = io.StringIO()
    logs.start(form=form, stream=stream)
    log = logging.getLogger("rayfarm.api")
    log.warning("%s", text, extra=facts(of=text))
    try:
        raise RuntimeError(text)
    except RuntimeError:
        log.exception("failed")
    assert secret not in stream.getvalue()
    assert stream.getvalue().count(logs.HIDDEN) >= 3


def test_what_nobody_catches_is_a_line_too() -> None:
    program = (
        "import threading, warnings; from server import logs; logs.start(); warnings.warn('old')\n"
        "thread = threading.Thread(target=lambda: 1 / 0, name='care'); thread.start(); thread.join(); [][0]"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    old, within, last = (json.loads(line) for line in done.stderr.splitlines())
    assert "old" in old["what"]
    assert within["what"].startswith("care ended")
    assert "ZeroDivisionError" in within["error"]
    assert "IndexError" in last["error"]
