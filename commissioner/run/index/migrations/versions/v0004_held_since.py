"""Since when a drive holds what it holds, and that a run lacks its result: every archive reads its folders again."""

from __future__ import annotations

from alembic import op

revision = "0004"
down_revision = "0003"


def upgrade() -> None:
    """No folder's journal has this stamp; until then the row is told as it was."""
    op.execute("UPDATE runs SET journal_bytes = -1")


def downgrade() -> None:
    """The words stay."""
