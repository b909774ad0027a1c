"""Workers, devices, and jobs that name their device."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None

TIME = sa.DateTime(timezone=True)
KEY = sa.String(200)


def upgrade() -> None:
    """Create the tables, and give jobs and slices their new columns."""
    op.create_table(
        "workers",
        sa.Column("id", KEY, primary_key=True),
        sa.Column("host", KEY, nullable=False, index=True),
        sa.Column("started_at", TIME, nullable=False),
        sa.Column("beat_at", TIME, nullable=False),
        sa.Column("ended_at", TIME, nullable=True),
        sa.Column("reaped_at", TIME, nullable=True),
        sa.Column("handed_on_at", TIME, nullable=True),
    )
    op.create_table(
        "devices",
        sa.Column("id", KEY, primary_key=True),
        sa.Column("kind", sa.String(16), nullable=False),
        sa.Column("host", KEY, nullable=True, index=True),
        sa.Column("address", KEY, nullable=True),
        sa.Column("presence", sa.String(16), nullable=False),
        sa.Column("advice", sa.Text, nullable=True),
        sa.Column("facts", sa.JSON, nullable=False),
        sa.Column("health", sa.JSON, nullable=True),
        sa.Column("health_at", TIME, nullable=True),
        sa.Column("set_aside", sa.Text, nullable=True),
        sa.Column("first_seen_at", TIME, nullable=False),
        sa.Column("seen_at", TIME, nullable=False),
    )
    with op.batch_alter_table("jobs") as jobs:
        jobs.add_column(sa.Column("device", KEY, nullable=False, server_default="llvmpipe", index=True))
        jobs.add_column(sa.Column("priority", sa.Integer, nullable=False, server_default="100"))
    with op.batch_alter_table("slices") as slices:
        slices.add_column(sa.Column("workflow", sa.String(64), nullable=True))
        slices.add_column(sa.Column("queue", KEY, nullable=True))
        slices.drop_column("beat_at")
    op.create_index("ix_slices_worker", "slices", ["worker"])
    # What was queued or ran under the old queue has no workflow: it waits to be put into the new one.
    op.execute("UPDATE slices SET state = 'waiting', worker = NULL WHERE state IN ('queued', 'running')")


def downgrade() -> None:
    """Drop what was added."""
    op.drop_index("ix_slices_worker", "slices")
    with op.batch_alter_table("slices") as slices:
        slices.add_column(sa.Column("beat_at", TIME, nullable=True))
        slices.drop_column("workflow")
        slices.drop_column("queue")
    with op.batch_alter_table("jobs") as jobs:
        jobs.drop_column("priority")
        jobs.drop_column("device")
    for table in ("devices", "workers"):
        op.drop_table(table)
