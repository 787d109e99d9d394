"""Which of two channel orders: the one whose power explains the slip that the currents show.

At light load two orders, 60 degrees apart, both make a motor. They differ in power by several times, so in the slip that the
operating point asks for; the shaft's lines lie where they lie, whatever the order.
"""

from __future__ import annotations

import numpy as np

from commissioner.monitor.intake.findings import Audited, Finding, miswired
from commissioner.monitor.machine.fit import Start
from commissioner.monitor.periods import periods
from commissioner.monitor.periods.combs import Found, mean_supply
from commissioner.monitor.periods.periods import ShaftSearch
from commissioner.monitor.signals.supply import TurningFrame
from commissioner.motor.nameplate import Nameplate
from commissioner.motor.running import slip_at_power

SLIP_TRUST = 0.25
"""Relative standard deviation of the slip that the plate and the measured power suggest: plate tolerance and warmth."""
LEAST_SLIP_STD = 0.0015
CLEAR = 6.0
"""Twice the logarithm of the likelihood ratio: 20 to 1, strong evidence in the scale of Kass and Raftery (1995)."""


def shaft_search(
    audited: Audited, frame: TurningFrame, part: slice, plate: Nameplate, start: Start, turned_deg: float = 0.0
) -> ShaftSearch:
    """Where the operating point puts the slip: the start circuit at the measured power, the current's lag larger by `turned_deg`.

    Its standard deviation holds the power's own, from the delay between the sensors, which counts near 90 degrees.
    """
    supply = mean_supply(frame, part)
    apparent = (
        1.5 * np.mean(frame.voltage_v[part] * np.conj(frame.current_a[part])) * np.exp(1j * np.radians(turned_deg))
    )
    power = float(apparent.real)
    voltage = float(abs(frame.voltage_v[part].mean()))
    slip = slip_at_power(start.circuit, supply, voltage, power)
    delay = abs(float(apparent.imag)) * supply * audited.sensors.skew_std_s
    late = slip_at_power(start.circuit, supply, voltage, power + delay) - slip
    std = float(np.hypot(np.hypot(SLIP_TRUST * slip, LEAST_SLIP_STD), late))
    return ShaftSearch(plate.pole_pairs, supply / (2 * np.pi), slip, std)


def better_order(
    audited: Audited,
    frame: TurningFrame,
    part: slice,
    plate: Nameplate,
    start: Start,
    search: ShaftSearch,
    found: Found,
) -> float | Finding | None:
    """None: the order stands. A lag in degrees: the order of that lag explains the slip, this one does not. A finding: neither
    stands out.

    Columns taken as they were named need no proof, but they may be contradicted.
    """
    corrected = bool(miswired(audited.findings))
    own = _evidence(found, search, frame)
    verdict: float | Finding | None = None
    for lag in audited.rivals_deg:
        rival = _evidence(found, shaft_search(audited, frame, part, plate, start, lag - audited.lag_deg), frame)
        if own > rival + CLEAR or (own >= rival and not corrected):
            continue
        if rival > own + CLEAR and corrected and 0.0 < lag < 90.0:
            verdict, own = lag, rival
        elif corrected or rival > own + CLEAR:
            return Finding(
                "pairing",
                "refused",
                f"the current lags by {audited.lag_deg:.0f} or by {lag:.0f} degrees, as the channels are ordered, and "
                + (
                    "the slip does not tell which"
                    if corrected
                    else "the slip contradicts the order that the columns name"
                ),
                audited.lag_deg,
                f"twice the logarithm of a likelihood ratio {CLEAR:g} ({own - rival:+.1f} found)",
                "check the clamps: which current belongs to which voltage, and the polarities; or record at more load",
            )
    return verdict


def _evidence(found: Found, search: ShaftSearch, frame: TurningFrame) -> float:
    """Score of the best comb in the slip range; a wide range has to share its likelihood."""
    candidates = periods.shaft_candidates(found.spectrum, search, periods.search_harmonics(frame.band_hz, search))
    best = max((score for _, score, _ in candidates), default=0.0)
    return best - 2 * float(np.log(search.slip_std))
