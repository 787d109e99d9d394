"""The two energised steps: the DC staircase and the multitone test, sample block by sample block."""

from __future__ import annotations

TELL_EVERY_S = 0.1
"""Motor time between two estimates in the journal."""
RAISE_EVERY_S = 0.2
"""Motor time between two raises of the amplitude: the flux must have answered to the last one."""
