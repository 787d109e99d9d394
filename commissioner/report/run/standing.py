"""How a run stands: its outcome, and whether the drive holds what came of it. Light: a list of runs needs no more."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

ACCEPTED, RESTORED_SINCE = "accepted, not written", "commissioned, restored since"
"""How a run stands that ended as commissioned while the drive does not hold its values."""


def standing(result: Mapping[str, Any]) -> str:
    """The outcome; of a result that was accepted, whether it was written as well."""
    outcome = str(result["outcome"])
    return ACCEPTED if outcome == "commissioned" and not result.get("written") else outcome
