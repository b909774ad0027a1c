"""A compiled job's listings: each GPU's disassembly beside the GLSL, one blob for all of them."""

from __future__ import annotations

import json
import logging
from typing import Any

from server.pictures.taken import is_name
from server.store.blobs import BlobError, Blobs

Json = dict[str, Any]
log = logging.getLogger("rayfarm.worker")

LISTED = ("disassembly", "weights")


def keep_listing(measurement: Json, blobs: Blobs) -> Json:
    """Move the listings of a measurement into a blob that `listing` names; None, with the reason logged, if that fails.

    The estimates are worth more than the listings: they are never lost with them.
    """
    rows = [dict(row) for row in measurement["gpus"]]
    listed = {row["gpu"]: {name: row.pop(name, None) for name in LISTED} for row in rows}
    content = json.dumps({"glsl": measurement.get("glsl"), "gpus": listed}, sort_keys=True).encode()
    name: str | None
    try:
        with blobs.receiving() as incoming:
            incoming.write(content)
            name = blobs.keep(incoming)
    except BlobError as error:
        log.warning("An estimate is recorded without its listings: %s", error)
        name = None
    kept = {key: value for key, value in measurement.items() if key != "glsl"}
    return kept | {"gpus": rows, "listing": name}


def read_listing(document: Json | None, blobs: Blobs) -> Json | None:
    """The listings of a job's result: `glsl`, and `gpus` by name; None where it has none.

    Raise BlobError where they cannot be read.
    """
    name = ((document or {}).get("compiled") or {}).get("listing")
    if not is_name(name):
        return None
    read = json.loads(b"".join(blobs.read(name)))
    return read if isinstance(read, dict) else None
