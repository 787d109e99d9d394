"""The magnetizing branch beside the rotor of a locked motor: what is taken for it where the points do not tell.

Left out, it makes the rotor's resistance too small by 1 + (R_R / w L_M)^2 and the leakage too large by R_R^2 / w^2 L_M: by 3 %
in small motors at their own frequency, by four times that at half of it.
"""

from __future__ import annotations

import numpy as np

from commissioner.diagnose.intake.points import Points

OF_ONE_VA, GROWTH = 3.6, 0.176
"""L_M over L_sigma of a motor whose locked rotor takes 1 VA at rated current, and its power of these volt-amperes: the regression
of 35 published machines of 0.18 kW ... 1.7 MW (tests/data/motors)."""
SPREAD = 0.4
"""Of the logarithm about that regression: 0.37 seen, and the table's largest current is not quite the rated one."""
ROTOR_SHARE = 0.43
"""Of R_s + R_R where the stator's own is not known; spread 0.09 in the same machines."""


def main_over_leakage(points: Points) -> float:
    """L_M over L_sigma as published machines of this size have it, by the largest volt-amperes measured."""
    largest = float(np.max(np.sqrt(3.0) * points.voltage_line_v * points.current_line_a))
    return float(OF_ONE_VA * largest**GROWTH)
