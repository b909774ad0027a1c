"""Taking up a round's pictures: from the folder that the measuring child wrote them into, into the blobs."""

from __future__ import annotations

import logging
import re
from pathlib import Path
from typing import TypeGuard

from server.store.blobs import BlobError, Blobs
from server.store.models import Json

log = logging.getLogger("rayfarm.worker")

SUFFIXES = {"image": ".png", "counts": ".npz"}
SHA256 = re.compile(r"[0-9a-f]{64}")


def is_name(value: object) -> TypeGuard[str]:
    """Whether a value is a picture's name: a sha256 in hexadecimal."""
    return isinstance(value, str) and SHA256.fullmatch(value) is not None


def take_up(measurement: Json, folder: Path, blobs: Blobs) -> Json:
    """Keep the pictures that a measurement names; without them, and with the reason logged, where that fails.

    A measurement is worth more than its pictures: it is never lost with them.
    """
    named = measurement.get("pictures")
    if named is None:
        return measurement
    try:
        for kind, suffix in SUFFIXES.items():
            name = named[kind]
            if kind == "counts" and name is None:
                continue
            if not is_name(name):
                raise BlobError(f"The {kind} of a round has no sha256 for a name: measure again.")
            blobs.keep_file(folder / f"{name}{suffix}", name)
    except BlobError as error:
        log.warning("A result is recorded without its pictures: %s", error)
    except Exception:
        log.exception("a result is recorded without its pictures")
    else:
        return measurement
    return measurement | {"pictures": None}
