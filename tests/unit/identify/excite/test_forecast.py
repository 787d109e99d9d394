"""The near future simulated: what need not be known to its end is not."""

import math

import numpy as np
import pytest

from commissioner.identify.excite.forecast import Forecast
from commissioner.identify.excite.tones import Excitation, Tone
from commissioner.identify.inverter.staircase import knee_shape
from commissioner.identify.observer.kernels import Held, forecast
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.standstill import held_input

MACHINE = InverseGamma(3.7, 2.09, 0.021, 0.224)
PERIOD_S = 8e-4


def test_a_current_that_passes_its_limit_is_followed_no_further():
    """A direct voltage for 1 A, ten times as much from the middle on: the peak is of the first half where the limit lies there."""
    matrix, gain = held_input(MACHINE, PERIOD_S)
    held = Held(matrix, gain, MACHINE.stator_resistance_ohm, MACHINE.leakage_inductance_h, np.zeros(2), 1.0)
    volts = np.repeat([3.7, 37.0], 5000)
    assert forecast(volts, PERIOD_S, held, (0.0, 0.0, 0.0), (math.inf, math.inf))[1] == pytest.approx(10.0, rel=1e-3)
    assert 0.5 <= forecast(volts, PERIOD_S, held, (0.0, 0.0, 0.0), (math.inf, 0.5))[1] < 1.0
    assert 0.1 <= forecast(volts, PERIOD_S, held, (0.0, 0.0, 0.0), (0.1, math.inf))[0] < 0.11


@pytest.mark.parametrize("scale", [0.2, 0.5, 1.0])
def test_what_keeps_below_is_what_the_peaks_say(scale):
    tones = Excitation((Tone(30.0, 0.7, 0.0), Tone(20.0, 19.8, 1.0)), 0.0, 3.0)
    ahead, time_s = Forecast.behind(knee_shape(4.0, 0.1, 2.0), tones, 0.0), np.arange(0.0, 3.0, PERIOD_S)
    flux_wb, current_a = ahead.peaks(MACHINE, time_s, scale)
    for share in (0.999, 1.001):
        assert ahead.keeps_below((share * flux_wb, math.inf), MACHINE, time_s)(scale) == (share > 1.0)
        assert ahead.keeps_below((math.inf, share * current_a), MACHINE, time_s)(scale) == (share > 1.0)
