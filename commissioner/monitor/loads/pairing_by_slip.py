"""Which of two channel orders: the one whose power explains the slip that the currents show.

At light load two orders, 60 degrees apart, both make a motor. They differ in power by several times, so in the slip that the
operating point asks for; the shaft's lines lie where they lie, whatever the order. So it is with a machine that generates, which
in another order looks like a motor: its shaft turns faster than the supply.
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
    if not _generates(audited, audited.lag_deg + turned_deg):
        slip = max(slip, 0.0)
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
    trust: str | None = None,
) -> float | Finding | None:
    """None: the order stands. A lag in degrees: the order of that lag explains the slip, this one does not. A finding: neither
    stands out.

    Columns taken as they were named need no proof, but they may be contradicted. `trust`, where a motor with crossed channels cannot be
    told from a generator with straight ones: "data" are as they are named, the "plate" is a motor's.
    """
    corrected = bool(miswired(audited.findings))
    own = _evidence(found, search, frame)
    verdict: float | Finding | None = None
    other = audited.generator if corrected else None
    for lag in audited.rivals_deg if other is None else {*audited.rivals_deg, other.lag_deg}:
        generates = other is not None and lag == other.lag_deg
        rival = _evidence(found, shaft_search(audited, frame, part, plate, start, lag - audited.lag_deg), frame)
        if own > rival + CLEAR or (own >= rival and not corrected):
            continue
        if rival > own + CLEAR and corrected and (generates or 0.0 < lag < 90.0):
            verdict, own = lag, rival
        elif generates:
            if trust == "data":
                return lag
            if trust is None and other is not None and other.is_named:
                return _generating_or_crossed(audited, lag, own - rival)
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


def _generates(audited: Audited, lag_deg: float) -> bool:
    return audited.generator is not None and abs(lag_deg - audited.generator.lag_deg) < 1.0


def _generating_or_crossed(audited: Audited, lag_deg: float, evidence: float) -> Finding:
    return Finding(
        "generating_or_crossed",
        "refused",
        f"not distinguishable: a machine that generates (the current lags by {lag_deg:.0f} degrees, as the columns are named), or a motor "
        f"with crossed current channels ({audited.lag_deg:.0f} degrees); no start is recorded that would tell, and the slip does not",
        lag_deg,
        f"twice the logarithm of a likelihood ratio {CLEAR:g} ({evidence:+.1f} found)",
        "where the columns are right, say --trust data; where the machine is a motor, name the current channels right (--map) or say "
        "--trust plate; or record with its start",
    )


def _evidence(found: Found, search: ShaftSearch, frame: TurningFrame) -> float:
    """Score of the best comb in the slip range; a wide range has to share its likelihood."""
    candidates = periods.shaft_candidates(found.spectrum, search, periods.search_harmonics(frame.band_hz, search))
    best = max((score for _, score, _ in candidates), default=0.0)
    return best - 2 * float(np.log(search.slip_std))
