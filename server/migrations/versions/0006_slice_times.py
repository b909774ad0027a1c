"""When a slice began and ended, for the time that a study still takes."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None

COLUMNS = ("started_at", "ended_at")


def upgrade() -> None:
    """Add the times; of slices that ended before they are unknown."""
    for name in COLUMNS:
        op.add_column("slices", sa.Column(name, sa.DateTime(timezone=True), nullable=True))


def downgrade() -> None:
    """Drop the times."""
    with op.batch_alter_table("slices") as slices:
        for name in COLUMNS:
            slices.drop_column(name)
