"""What a study that runs here has measured so far, in a file, so that an interrupted one goes on where it was."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import shutil
import socket
from collections import defaultdict, deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import resources
from importlib.metadata import version
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, BinaryIO

from platformdirs import user_state_path

from renderer.request import Request

Json = dict[str, Any]
MEASURING = ("scenes", "renderer", "shaders")
"""The packages that a measurement depends on."""


class JournalError(RuntimeError):
    """A journal that cannot be used; the message is one sentence that says what to do."""


@dataclass(frozen=True)
class Kept:
    """A slice's measurement and the seconds that it took."""

    seconds: float
    measurement: Json


@dataclass(frozen=True, eq=False)
class Journal:
    """A study's journal, held by this process alone: a line of JSON for each slice that has ended.

    `pictures` is the folder for the pictures that the measurements name. Several requests of a study may be alike: each
    takes one of the measurements kept for them.
    """

    path: Path
    _file: BinaryIO
    _kept: dict[tuple[str, int], deque[Kept]] = field(default_factory=lambda: defaultdict(deque))

    @property
    def pictures(self) -> Path:
        """The folder beside it."""
        return self.path.with_suffix("")

    def __len__(self) -> int:
        """How many measurements were kept before and not taken yet."""
        return sum(len(each) for each in self._kept.values())

    def take(self, request: Request, round_index: int) -> Kept | None:
        """A measurement of the slice that was kept before, once; None when there is none."""
        kept = self._kept[request.key, round_index]
        return kept.popleft() if kept else None

    def keep(self, request: Request, round_index: int, kept: Kept) -> None:
        """Keep a slice's measurement; it is on the disk when this returns."""
        line = {"request": request.key, "round": round_index, "seconds": kept.seconds, "measurement": kept.measurement}
        try:
            self._file.write(json.dumps(line).encode() + b"\n")
            self._file.flush()
            os.fsync(self._file.fileno())
        except OSError as error:
            raise _unusable(self.path, error) from error

    def start_anew(self) -> None:
        """Forget everything."""
        self._kept.clear()
        self._file.truncate(0)
        shutil.rmtree(self.pictures, ignore_errors=True)

    def remove(self) -> None:
        """Remove the file and the pictures: the study is over."""
        self.path.unlink(missing_ok=True)
        shutil.rmtree(self.pictures, ignore_errors=True)


@contextmanager
def open_journal(requests: Sequence[Request]) -> Iterator[Journal]:
    """The journal of a study's requests; raise JournalError while another process has it."""
    path = user_state_path("rayfarm", appauthor=False) / "studies" / f"{_key(requests)}.jsonl"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = _locked(path)
    except BlockingIOError as error:
        raise JournalError("This study is running here already: wait for its end, or stop it.") from error
    except OSError as error:
        raise _unusable(path, error) from error
    with file:
        journal = Journal(path, file)
        _read(journal, file)
        yield journal


def _key(requests: Sequence[Request]) -> str:
    """What measurements may be mixed: those of the same requests by the same program on the same host."""
    digest = hashlib.sha256()
    for part in (version("rayfarm"), socket.gethostname(), *(request.key for request in requests)):
        digest.update(f"{part}\n".encode())
    for package in MEASURING:
        for text in _texts(resources.files(package)):
            digest.update(text)
    return digest.hexdigest()[:16]


def _texts(folder: Traversable) -> Iterator[bytes]:
    for entry in sorted(folder.iterdir(), key=lambda each: each.name):
        if entry.is_dir() and entry.name != "__pycache__":
            yield from _texts(entry)
        elif entry.is_file():
            yield entry.read_bytes()


def _locked(path: Path) -> BinaryIO:
    """The file, locked to the end of its use; raise BlockingIOError when another process has it."""
    while True:
        file = path.open("ab+")
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.path.samestat(os.fstat(file.fileno()), path.stat()):
                return file
        except FileNotFoundError:
            pass  # Whoever had it removed it meanwhile.
        except BaseException:
            file.close()
            raise
        file.close()


def _read(journal: Journal, file: BinaryIO) -> None:
    """Read what was kept; from a line on that was not written whole all is measured again."""
    file.seek(0)
    whole = 0
    for line in file:
        try:
            entry = json.loads(line) if line.endswith(b"\n") else {}
            kept = Kept(float(entry["seconds"]), dict(entry["measurement"]))
            journal._kept[str(entry["request"]), int(entry["round"])].append(kept)
        except (ValueError, KeyError, TypeError):
            break
        whole += len(line)
    file.truncate(whole)
    file.seek(whole)


def _unusable(path: Path, error: OSError) -> JournalError:
    reason = error.strerror or str(error)
    return JournalError(f"The journal {path} cannot be written ({reason}): free the folder, or set XDG_STATE_HOME.")
