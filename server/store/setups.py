"""Set-ups: what a result was measured on and with. Thousands of results share a few of them, each stored once."""

from __future__ import annotations

import hashlib
import json
from typing import Any

from sqlalchemy import select
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.orm import Session

from renderer.variant import AXES
from server.comparison.flat import COLUMNS, flatten_document
from server.store.models import Setup

SETUP = (
    *AXES,
    *("scene", "device_id", "device_name", "device_driver", "device_threads", "size", "rays_kind", "specialised"),
    *("sah_traversal", "sah_intersection"),
)
"""What two results of one cell of a comparison may differ in."""

VERSIONS = ("versions_rayfarm", "versions_plan", "versions_shader_sha")
"""What else they may differ in; named where the set-up does not explain it."""

FACTS = (*SETUP, *VERSIONS, "family")
"""A set-up's facts, by their names in a flat row; beside them stand its `fields`."""


def facts_of(document: dict[str, Any]) -> dict[str, Any]:
    """The set-up of a result; `fields` are the columns that its flat row has beside those of every table."""
    flat = flatten_document(document)
    return {name: flat.get(name) for name in FACTS} | {"fields": [name for name in flat if name not in COLUMNS]}


def digest_of(facts: dict[str, Any]) -> str:
    """What set-ups are told apart by."""
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()


def require_setup(session: Session, facts: dict[str, Any]) -> int:
    """The id of a set-up, which is added where it is new; two processes may add the same one at once."""
    digest = digest_of(facts)
    known = select(Setup.id).where(Setup.digest == digest)
    found = session.scalar(known)
    if found is None:
        insert = postgresql.insert if session.get_bind().dialect.name == "postgresql" else sqlite.insert
        session.execute(insert(Setup).values(digest=digest, facts=facts).on_conflict_do_nothing())
        found = session.scalars(known).one()
    return found
