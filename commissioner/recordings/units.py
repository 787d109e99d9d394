"""Units as people write them behind a name, in a row of their own, or in a channel's properties."""

from __future__ import annotations

import math
import re

SCALE = {"n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "": 1.0, "k": 1e3, "M": 1e6}
UNIT = re.compile(r"^[\[(]?\s*(n|u|µ|μ|m|k|M)?(s|sec|a|v|rad/s|1/min|rpm|hz)\s*[\])]?$", re.IGNORECASE)
IN_NAME = re.compile(r"[\[(]\s*([^\])]*)\s*[\])]\s*$|_(ms|us|s|mA|A|mV|V|kV|rpm)$")


def unit_in(name: str) -> str:
    found = IN_NAME.search(name)
    return (found.group(1) or found.group(2) or "") if found else ""


def scale_of(unit: str) -> float:
    """Factor to SI: 1e-3 for mA, 2 pi / 60 for rpm; 1 where no unit is recognised."""
    found = UNIT.match(unit.strip())
    if not found:
        return 1.0
    if found.group(2).lower() in {"rpm", "1/min"}:
        return math.pi / 30
    prefix = found.group(1) or ""
    return SCALE.get(prefix, SCALE.get(prefix.lower(), 1.0))
