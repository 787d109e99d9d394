"""A plate in the words of today: every archive reads its folders again when it next lists them."""

from __future__ import annotations

from alembic import op

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    """No folder's journal has this stamp; until then the row is told as it was."""
    op.execute("UPDATE runs SET journal_bytes = -1")


def downgrade() -> None:
    """The words stay."""
