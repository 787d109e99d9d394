"""Recordings that cannot be of a motor at rest behind the commanded voltage: said before any model is fitted."""

from __future__ import annotations

import numpy as np

from commissioner.diagnose.intake.record import TO_PHASES, Record, Segment
from commissioner.diagnose.intake.refusal import refused
from commissioner.errors import DataRefused

LEAST_PROJECTION = 0.2
"""Share of a segment's current that a phase must carry, by the axis, to be missed when it is silent."""
MOST_ACROSS = 0.6
"""Current across the excited axis over current along it: a shaft that creeps makes a tenth."""
LATEST_PERIODS = 3.0
"""Sampling periods by which a current may be read late: two of delay, half of one for a held command, and a lag."""
LEAST_SHARE_BELOW = 0.1
"""Of the current, where the latest reading turns it by less than 90 degrees: fewer lines are leakage and offsets."""
LEAST_LAG_FACTOR = -0.1
"""Motors have 0.4 to 0.9 whatever cause is in them, and the negative of it with a sign turned; a foreign current has 0."""
MOST_CURRENT = 20.0
"""Times the rated peak: no drive gives so much to its motor."""
LEAST_IMPEDANCE, MOST_IMPEDANCE = 5e-4, 30.0
"""Of the rated impedance, volts over amperes of a motor at rest: R_s has 0.005 (400 kW) to 0.15 of it, L_M 1 to 4 times."""
PHASES = ("u", "v", "w")


def contradiction(record: Record) -> DataRefused | None:
    """Why these currents cannot be the answer to this command, or None."""
    return _unlikely_units(record) or _silent_phase(record) or _wrong_direction(record) or _wrong_sign(record)


def _unlikely_units(record: Record) -> DataRefused | None:
    """Currents, or volts per ampere, that no motor of this nameplate has."""
    facts = record.facts
    volts, amps = (
        float(np.sqrt(np.mean(np.concatenate(rows) ** 2)))
        for rows in (
            [s.voltage_axis_v for s in record.segments],
            [s.axis_current_a[s.is_good] for s in record.segments],
        )
    )
    over = facts.current_peak_a / facts.rated_current_peak_a
    if over > MOST_CURRENT:
        return refused(
            f"the currents reach {facts.current_peak_a:.4g} A, {over:.3g} times the rated peak",
            over,
            f"at most {MOST_CURRENT:g} times",
            "check the unit (amperes, not milliamperes) and the rated current of the nameplate",
        )
    voltage = facts.metadata.get("rated_voltage_v")
    if isinstance(voltage, int | float) and "rated_current_a" in facts.metadata and amps > 0.0:
        rated = np.sqrt(2.0 / 3.0) * float(voltage) / facts.rated_current_peak_a
        share = volts / amps / rated
        if not LEAST_IMPEDANCE < share < MOST_IMPEDANCE:
            return refused(
                f"{volts:.3g} V drive {amps:.3g} A: {share:.2g} of the motor's rated impedance of {rated:.3g} ohm",
                share,
                f"{LEAST_IMPEDANCE:g} to {MOST_IMPEDANCE:g} of it",
                "check the units (volts, amperes) and the nameplate",
            )
    return None


def _silent_phase(record: Record) -> DataRefused | None:
    swing = np.array([max(float(np.ptp(s.currents_a[p])) for s in record.segments) for p in range(record.facts.phases)])
    for phase in np.flatnonzero(swing < 1e-6 * swing.max()):
        share = max(abs(float(TO_PHASES[phase] @ _direction(s))) for s in record.segments)
        if share > LEAST_PROJECTION:
            return refused(
                f"the current of phase {PHASES[phase]} stands still while the others flow: its sensor or lead is not connected",
                float(swing[phase]),
                f"about {share:.0%} of the others' {swing.max():.3g} A",
                "connect it and record again",
            )
    return None


def _direction(segment: Segment) -> np.ndarray:
    angle = np.deg2rad(segment.axis_deg)
    return np.array([np.cos(angle), np.sin(angle)])


def _wrong_sign(record: Record) -> DataRefused | None:
    """A motor at rest takes energy: its current lags by 0 to 90 degrees, and seems to lag by more where it is read late.

    The power itself of an inductive tone read a little late is negative: the lag is held against the middle of all that can be.
    """
    taken, scale = 0.0, 0.0
    for segment in record.segments:
        amps = np.fft.rfft(segment.axis_current_a)
        turn = np.fft.rfftfreq(segment.count, segment.period_s) * LATEST_PERIODS * segment.period_s
        is_below = turn < 0.25
        below = amps[is_below]
        if np.linalg.norm(below) < LEAST_SHARE_BELOW * np.linalg.norm(amps):
            continue
        volts = np.fft.rfft(segment.voltage_axis_v)[is_below]
        middle = np.exp(1j * np.pi * (0.25 + turn[is_below]))
        taken += float(np.vdot(below * middle, volts).real)
        scale += float(np.linalg.norm(volts) * np.linalg.norm(below))
    if taken < LEAST_LAG_FACTOR * scale:
        return refused(
            "the currents flow against the voltage, as if a motor at rest gave power",
            taken / scale,
            f"at least {LEAST_LAG_FACTOR}",
            "turn the sign of one of them",
        )
    return None


def _wrong_direction(record: Record) -> DataRefused | None:
    along, across = 0.0, 0.0
    for segment in record.segments:
        inverse = np.linalg.pinv(TO_PHASES[: record.facts.phases])
        vector = inverse @ segment.currents_a[:, segment.is_good]
        vector = vector - vector.mean(axis=1, keepdims=True)
        a, b = _direction(segment)
        along += float(((a * vector[0] + b * vector[1]) ** 2).sum())
        across += float(((a * vector[1] - b * vector[0]) ** 2).sum())
    if across > MOST_ACROSS**2 * along:
        share = float(np.sqrt(across / max(along, 1e-300)))
        return refused(
            f"the current does not follow the excited axis (across it flows {share:.0%} of what flows along it): a shaft that "
            "turns, phases in another order, or a wrong axis column",
            share,
            f"at most {MOST_ACROSS:.0%}",
            "check phases and axis; `commissioner monitor` reads a running motor",
        )
    return None
