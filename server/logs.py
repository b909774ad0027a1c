"""Logs on standard error: one JSON object a line, or plain lines where standard error is a terminal.

An object has `time` (UTC), `level`, `logger`, `what`, what it is about (`job`, `slice`, `device`, ...) where that is
known, and `error` with a traceback. What looks like a secret, or is one of this process's, is never written.
"""

from __future__ import annotations

import json
import logging
import os
import re
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from datetime import UTC, datetime
from typing import Any, Literal, TextIO

Level = Literal["debug", "info", "warning", "error"]
Form = Literal["auto", "json", "text"]

HIDDEN = "***"
FACTS = "facts"
_ABOUT: ContextVar[Mapping[str, Any]] = ContextVar("about")
_SECRETS = (
    re.compile(r"(\b[0-9a-f]{12}\.)[A-Za-z0-9_-]{43}"),  # a token or a session: `server.access.tokens`
    re.compile(r"(://[^\s:/@]*:)[^\s@]+(?=@)"),
    re.compile(r"(\bbearer )\S+", re.IGNORECASE),
    re.compile(r"(\bpassword=)[^\s&]+", re.IGNORECASE),
)
_SECRET_NAME = re.compile(r"SECRET|PASSWORD|TOKEN$")
_SHORTEST = 8
"""A shorter value of a variable might be any word."""


def facts(**values: Any) -> dict[str, Any]:
    """What an event is about, to be given as a logging call's `extra`."""
    return {FACTS: values}


@contextmanager
def about(**values: Any) -> Iterator[None]:
    """What all events of the block, its tasks and its threads are about."""
    token = _ABOUT.set({**_ABOUT.get({}), **values})
    try:
        yield
    finally:
        _ABOUT.reset(token)


def start(level: Level = "info", form: Form = "auto", stream: TextIO | None = None) -> None:
    """Log this process's events, its warnings and what nobody catches, on standard error."""
    stream = stream or sys.stderr
    plain = form == "text" or (form == "auto" and stream.isatty())
    handler = logging.StreamHandler(stream)
    handler.setFormatter(Plain() if plain else JsonLines())
    handler.addFilter(_is_news)
    logging.basicConfig(level=logging.WARNING, handlers=[handler], force=True)
    logging.getLogger("rayfarm").setLevel(level.upper())
    logging.captureWarnings(True)
    sys.excepthook = _uncaught
    threading.excepthook = _uncaught_in_thread


def without_secrets(text: str) -> str:
    """The text with every secret hidden that can be told by its form or by this process's environment."""
    for pattern in _SECRETS:
        text = pattern.sub(rf"\1{HIDDEN}", text)
    for name, value in os.environ.items():
        if len(value) >= _SHORTEST and _SECRET_NAME.search(name):
            text = text.replace(value, HIDDEN)
    return text


class JsonLines(logging.Formatter):
    """One JSON object a line, in ASCII: nothing that a phone or a request says can forge a line."""

    def format(self, record: logging.LogRecord) -> str:
        """The line."""
        line = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "what": record.getMessage(),
            **_facts_of(record),
        }
        if record.exc_info:
            line["error"] = self.formatException(record.exc_info)
        return without_secrets(json.dumps(line, default=str))


class Plain(logging.Formatter):
    """For people: the local time, the level where it is no mere information, the event, what it is about."""

    def format(self, record: logging.LogRecord) -> str:
        """The line, and below it a traceback where there is one."""
        told = ", ".join(f"{name} {value}" for name, value in _facts_of(record).items())
        level = "" if record.levelno <= logging.INFO else f"{record.levelname.lower()}: "
        line = f"{datetime.fromtimestamp(record.created):%H:%M:%S} {level}{record.getMessage()}"
        line += f" ({told})" if told else ""
        if record.exc_info:
            line += f"\n{self.formatException(record.exc_info)}"
        return without_secrets("".join(c if c.isprintable() or c == "\n" else "?" for c in line))


def _facts_of(record: logging.LogRecord) -> dict[str, Any]:
    found = {**_ABOUT.get({}), **getattr(record, FACTS, {})}
    return {name: value for name, value in found.items() if value is not None}


def _is_news(record: logging.LogRecord) -> bool:
    """`server.problems` has logged it with its request."""
    return not (record.name == "uvicorn.error" and record.msg.startswith("Exception in ASGI application"))


def _uncaught(kind: type[BaseException], error: BaseException, trace: Any) -> None:
    if issubclass(kind, KeyboardInterrupt):
        sys.__excepthook__(kind, error, trace)
        return
    logging.getLogger("rayfarm").critical("the process ends: nobody expected this", exc_info=(kind, error, trace))


def _uncaught_in_thread(told: threading.ExceptHookArgs) -> None:
    if told.exc_value is None or isinstance(told.exc_value, SystemExit):
        return
    name = told.thread.name if told.thread else "a thread"
    trace = (told.exc_type, told.exc_value, told.exc_traceback)
    logging.getLogger("rayfarm").critical("%s ended: nobody expected this", name, exc_info=trace)
