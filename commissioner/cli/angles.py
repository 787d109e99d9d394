"""Axis orientations as they are written on the command line."""

from __future__ import annotations

from commissioner.errors import UsageError


def parse_axes(text: str | None) -> tuple[float, ...] | None:
    """`0,60,120` as numbers; None where the procedure's own are to be used."""
    if text is None:
        return None
    try:
        axes = tuple(float(part) for part in text.split(","))
    except ValueError:
        axes = ()
    if not axes or len(axes) > 12 or not all(-360 <= axis <= 360 for axis in axes):
        raise UsageError(
            f"--axes {text!r} is not a list of angles",
            step="command line",
            value=text,
            limit="1 to 12 electrical degrees within -360 ... 360, separated by commas",
            remedy="write --axes 0,60,120",
        )
    return axes
