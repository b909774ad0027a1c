"""Studies, jobs, slices, changes of state, results."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None

AXES = ("traversal", "method", "layout", "intersector", "box", "nodes", "precision", "offset", "builder")
TIME = sa.DateTime(timezone=True)
STATE = sa.String(16)


def upgrade() -> None:
    """Create the tables."""
    op.create_table(
        "studies",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("name", sa.String(200), nullable=False),
        sa.Column("request", sa.JSON, nullable=False),
        sa.Column("refused", sa.JSON, nullable=False),
        sa.Column("created_at", TIME, nullable=False),
    )
    op.create_table(
        "jobs",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("study_id", sa.Integer, sa.ForeignKey("studies.id"), nullable=True, index=True),
        sa.Column("scene", sa.String(200), nullable=False),
        sa.Column("label", sa.String(300), nullable=False),
        sa.Column("request", sa.JSON, nullable=False),
        sa.Column("state", STATE, nullable=False, index=True),
        sa.Column("reason", sa.Text, nullable=True),
        sa.Column("created_at", TIME, nullable=False),
        sa.Column("started_at", TIME, nullable=True),
        sa.Column("finished_at", TIME, nullable=True),
    )
    op.create_table(
        "slices",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("job_id", sa.Integer, sa.ForeignKey("jobs.id"), nullable=False),
        sa.Column("round", sa.Integer, nullable=False),
        sa.Column("state", STATE, nullable=False),
        sa.Column("attempts", sa.Integer, nullable=False),
        sa.Column("worker", sa.String(200), nullable=True),
        sa.Column("beat_at", TIME, nullable=True),
        sa.Column("measurement", sa.JSON, nullable=True),
        sa.UniqueConstraint("job_id", "round"),
        sa.Index("ix_slices_state_job", "state", "job_id"),
    )
    op.create_table(
        "changes",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("job_id", sa.Integer, sa.ForeignKey("jobs.id"), nullable=False, index=True),
        sa.Column("state", STATE, nullable=False),
        sa.Column("reason", sa.Text, nullable=True),
        sa.Column("at", TIME, nullable=False),
    )
    op.create_table(
        "results",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("job_id", sa.Integer, sa.ForeignKey("jobs.id"), nullable=False, unique=True),
        sa.Column("recorded_at", TIME, nullable=False, index=True),
        sa.Column("scene", sa.String(200), nullable=False, index=True),
        sa.Column("device", sa.String(200), nullable=False, index=True),
        *(sa.Column(axis, sa.String(64), nullable=False) for axis in AXES),
        sa.Column("document", sa.JSON, nullable=False),
    )


def downgrade() -> None:
    """Drop the tables."""
    for table in ("results", "changes", "slices", "jobs", "studies"):
        op.drop_table(table)
