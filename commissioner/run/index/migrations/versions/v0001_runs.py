"""The table of runs."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
_TEXTS = (
    "started_utc", "outcome", "standing", "reason", "drive", "holds", "person", "motor", "motor_serial", "plate", "document",
)  # fmt: skip


def upgrade() -> None:
    """As `rows.CREATE`; a test compares the two."""
    op.create_table(
        "runs",
        sa.Column("place", sa.Text, primary_key=True),
        sa.Column("run", sa.Text, primary_key=True),
        sa.Column("folder", sa.Text, nullable=False),
        sa.Column("journal_bytes", sa.BigInteger, nullable=False),
        sa.Column("journal_mtime_ns", sa.BigInteger, nullable=False),
        *(sa.Column(name, sa.Text, nullable=False) for name in _TEXTS),
    )
    op.create_index("runs_by_motor", "runs", ["motor"])
    op.create_index("runs_in_step", "runs", ["place", "run", "journal_bytes", "journal_mtime_ns"])


def downgrade() -> None:
    op.drop_table("runs")
