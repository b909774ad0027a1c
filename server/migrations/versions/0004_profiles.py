"""Imported profiles and their metrics."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Create the tables."""
    op.create_table(
        "profiles",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("job_id", sa.Integer, sa.ForeignKey("jobs.id"), nullable=False, index=True),
        sa.Column("format", sa.String(32), nullable=False),
        sa.Column("column_map", sa.JSON),
        sa.Column("file_name", sa.String(200), nullable=False),
        sa.Column("sha256", sa.String(64), nullable=False, index=True),
        sa.Column("size", sa.BigInteger, nullable=False),
        sa.Column("rows", sa.BigInteger, nullable=False),
        sa.Column("imported_at", sa.DateTime(timezone=True), nullable=False),
    )
    op.create_table(
        "profile_metrics",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("profile_id", sa.Integer, sa.ForeignKey("profiles.id"), nullable=False, index=True),
        sa.Column("name", sa.String(300), nullable=False),
        sa.Column("instance", sa.String(100)),
        sa.Column("source", sa.String(300)),
        sa.Column("unit", sa.String(100)),
        sa.Column("count", sa.BigInteger, nullable=False),
        sa.Column("mean", sa.Float(53), nullable=False),
        sa.Column("median", sa.Float(53), nullable=False),
        sa.Column("min", sa.Float(53), nullable=False),
        sa.Column("max", sa.Float(53), nullable=False),
        sa.Column("first_time", sa.String(100)),
        sa.Column("last_time", sa.String(100)),
    )


def downgrade() -> None:
    """Drop the tables."""
    op.drop_table("profile_metrics")
    op.drop_table("profiles")
