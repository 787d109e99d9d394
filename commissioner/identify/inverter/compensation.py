"""What the observers take off before they see a linear machine: inverter voltage error, extra magnetizing current,
delay."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from commissioner.records import Signal

_NONE = np.zeros(1)


@dataclass(frozen=True)
class Compensation:
    """Odd functions tabulated on equal steps from 0 to their span; a single 0 stands for "none".

    `lost_v` is the voltage the inverter loses along the axis over the current along it; `extra_a` the magnetizing
    current beyond psi / L_s of unsaturated iron over the stator flux; `delay_s` how much later than commanded the
    voltage acts (one period at most).
    """

    lost_v: Signal = field(default_factory=lambda: _NONE)
    lost_span_a: float = 1.0
    extra_a: Signal = field(default_factory=lambda: _NONE)
    extra_span_wb: float = 1.0
    delay_s: float = 0.0


NOTHING = Compensation()
