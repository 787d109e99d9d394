"""The catalogue: 27 causes by name. A new one is one entry in one of these files."""

from __future__ import annotations

from commissioner.diagnose.catalogue import heating, inverter, magnetics, sensing
from commissioner.diagnose.catalogue.effect import Effect, Setting

CATALOGUE: dict[str, Effect] = {
    entry.name: entry for entry in (*inverter.ENTRIES, *magnetics.ENTRIES, *heating.ENTRIES, *sensing.ENTRIES)
}

__all__ = ["CATALOGUE", "Effect", "Setting"]
