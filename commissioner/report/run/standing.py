"""How a run stands: its outcome, whether the drive holds what came of it, what its axes showed. Light: lists and screens need no more."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

ACCEPTED, RESTORED_SINCE, UNSURE = "accepted, not written", "commissioned, restored since", "commissioned, old or new"
"""How a run stands that ended as commissioned while the drive does not hold its values, or nobody knows whether it does: a write-back or
a restore since did not end."""


def standing(result: Mapping[str, Any]) -> str:
    """The outcome; of a result that was accepted, whether it was written as well."""
    outcome = str(result["outcome"])
    return ACCEPTED if outcome == "commissioned" and not result.get("written") else outcome


def finding_sentences(result: Mapping[str, Any]) -> list[str]:
    """What the axes' comparison saw, each with its size and 95 % interval."""
    from commissioner.report.sheet.numbers import half_width, with_interval  # with numpy behind it

    return [
        f"{f['sentence']}, by {with_interval(100 * abs(f['relative_size']), half_width(f['relative_std'], 100))} %"
        for f in result.get("findings") or ()
    ]
