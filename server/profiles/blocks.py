"""A file in blocks of whole rows, so that no file, however large or broken, is held in memory at once."""

from __future__ import annotations

from collections.abc import Iterator
from typing import BinaryIO

from server.profiles.errors import ProfileError

BLOCK = 1 << 21
MAX_ROW = 1 << 18
BOM = b"\xef\xbb\xbf"
WIDE_BOMS = (b"\xff\xfe", b"\xfe\xff")


def read_first_line(file: BinaryIO) -> str:
    """The first line without a byte order mark; raise ProfileError when it is no text."""
    line = file.readline(MAX_ROW)
    if not line:
        raise ProfileError("The file is empty: export the profile again.")
    if line.startswith(WIDE_BOMS):
        raise ProfileError("The file is UTF-16 text: save it as CSV in UTF-8.")
    _require_text(line)
    if len(line) == MAX_ROW and not line.endswith(b"\n"):
        raise ProfileError("The file is no CSV: its first line does not end.")
    return _decoded(line.removeprefix(BOM))


def read_blocks(file: BinaryIO) -> Iterator[str]:
    """The rest of a file in blocks of about BLOCK bytes, each of whole rows; a row may hold quoted line ends.

    Raise ProfileError where the file is no UTF-8 text, where a quote stays open, and where the last line has no end:
    nothing else tells a file that was cut within a figure.
    """
    kept = b""
    while chunk := file.read(BLOCK):
        _require_text(chunk)
        kept += chunk
        end = _last_row_end(kept)
        if end:
            yield _decoded(kept[:end])
            kept = kept[end:]
        if len(kept) > BLOCK + MAX_ROW:
            raise ProfileError(f"The file is no CSV: a row has more than {MAX_ROW} bytes or a quote stays open.")
    if kept.count(b'"') % 2:
        raise ProfileError("The file ends within quotes: it was cut, export the profile again.")
    if kept.strip():
        raise ProfileError("The file ends within a line: it was cut, or add a line end if it is whole.")


def _last_row_end(data: bytes) -> int:
    """Where the last whole row ends: the last line end with an even number of quotes before it, 0 for none."""
    end, odd = len(data), data.count(b'"') % 2
    while (at := data.rfind(b"\n", 0, end)) >= 0:
        if (odd + data.count(b'"', at, end)) % 2 == 0:
            return at + 1
        odd = (odd + data.count(b'"', at, end)) % 2
        if len(data) - at > MAX_ROW:
            return 0
        end = at
    return 0


def _require_text(data: bytes) -> None:
    if b"\0" in data:
        raise ProfileError("The file is no CSV but binary data: export the profile as CSV.")


def _decoded(data: bytes) -> str:
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise ProfileError("The file is not UTF-8 text: save it as CSV in UTF-8.") from error
