"""DC link behind a rectifier, compiled."""

from __future__ import annotations

import numpy as np

from commissioner.compiled import kernel


@kernel
def behind_diodes(power, ratio):
    """Means over each period, (n,), of what a capacitor behind diodes has lost, from `power` (n,) that is held over each.

    S dy/dt = power - y while the diodes conduct (y >= 0); above the mains' voltage nothing flows, and what is given back stays:
    S dy/dt = power. `ratio`: the period over S. Exact within each period.
    """
    out = np.empty(power.size)
    lost = 0.0
    for k in range(power.size):
        drawn, left, area = power[k], ratio, 0.0
        while left > 0.0:
            span, begin = left, lost
            if lost > 0.0 or (lost == 0.0 and drawn > 0.0):
                if drawn < 0.0:
                    span = min(left, np.log(1.0 - lost / drawn))
                lost = drawn + (begin - drawn) * np.exp(-span)
                area += drawn * span + begin - lost
            else:
                if drawn > 0.0:
                    span = min(left, -lost / drawn)
                lost = begin + drawn * span
                area += 0.5 * (begin + lost) * span
            if span < left:
                lost = 0.0
            left -= span
        out[k] = area / ratio
    return out
