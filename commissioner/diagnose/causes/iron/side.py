"""On which side of the leakage the iron's flux is taken."""

from __future__ import annotations

from commissioner.diagnose.kernels.kinds import NU
from commissioner.diagnose.plant.model import Term


def split(cause: str) -> Term:
    """Where between rotor (-0.5) and stator (+0.5) side of the leakage the iron's flux is taken."""
    return Term(cause, "split", "1", NU, 0, 0.1, -0.5, 0.5)
