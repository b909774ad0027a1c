"""The axis `fetch`: what was recorded before it was there fetched from storage buffers."""

from __future__ import annotations

import hashlib
import json
from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0010"
down_revision = "0009"
branch_labels = None
depends_on = None

CHUNK = 500
STORAGE = "storage"
SETUPS = sa.table("setups", sa.column("id"), sa.column("digest"), sa.column("facts", sa.JSON))
RESULTS = sa.table("results", sa.column("id"), sa.column("document", sa.JSON))


def upgrade() -> None:
    """Add the column, and name the value in documents and set-ups."""
    op.add_column("results", sa.Column("fetch", sa.String(64), nullable=False, server_default=STORAGE))
    connection = op.get_bind()
    _document_results(connection, lambda document: {**document, "fetch": STORAGE})
    _change_setups(connection, lambda facts: {**facts, "fetch": STORAGE})


def downgrade() -> None:
    """Drop it."""
    connection = op.get_bind()
    _document_results(connection, _without)
    _change_setups(connection, _without)
    op.drop_column("results", "fetch")


def _without(document: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in document.items() if name != "fetch"}


def _document_results(connection: sa.Connection, change: Any) -> None:
    last = 0
    page = sa.select(RESULTS.c.id, RESULTS.c.document).order_by(RESULTS.c.id).limit(CHUNK)
    update = sa.update(RESULTS).where(RESULTS.c.id == sa.bindparam("result"))
    while rows := connection.execute(page.where(RESULTS.c.id > last)).all():
        connection.execute(update, [{"result": number, "document": change(document)} for number, document in rows])
        last = rows[-1][0]


def _change_setups(connection: sa.Connection, change: Any) -> None:
    for number, facts in connection.execute(sa.select(SETUPS.c.id, SETUPS.c.facts)).all():
        changed = change(facts)
        digest = hashlib.sha256(json.dumps(changed, sort_keys=True).encode()).hexdigest()
        connection.execute(sa.update(SETUPS).where(SETUPS.c.id == number).values(digest=digest, facts=changed))
