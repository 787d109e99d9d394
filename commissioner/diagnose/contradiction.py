"""Recordings that cannot be of a motor at rest behind the commanded voltage: said before any model is fitted."""

from __future__ import annotations

import numpy as np

from commissioner.diagnose.record import TO_PHASES, Record, Segment

LEAST_PROJECTION = 0.2
"""Share of a segment's current that a phase must carry, by the axis, to be missed when it is silent."""
MOST_ACROSS = 0.6
"""Current across the excited axis over current along it: a shaft that creeps makes a tenth."""
LEAST_POWER_FACTOR = -0.05
PHASES = ("u", "v", "w")


def contradiction(record: Record) -> str | None:
    """Why these currents cannot be the answer to this command, or None."""
    return _silent_phase(record) or _wrong_direction(record) or _wrong_sign(record)


def _silent_phase(record: Record) -> str | None:
    swing = np.array([max(float(np.ptp(s.currents_a[p])) for s in record.segments) for p in range(record.facts.phases)])
    for phase in np.flatnonzero(swing < 1e-6 * swing.max()):
        share = max(abs(float(TO_PHASES[phase] @ _direction(s))) for s in record.segments)
        if share > LEAST_PROJECTION:
            return (
                f"the current of phase {PHASES[phase]} stands still while the others flow: its sensor or lead is not "
                "connected"
            )
    return None


def _direction(segment: Segment) -> np.ndarray:
    angle = np.deg2rad(segment.axis_deg)
    return np.array([np.cos(angle), np.sin(angle)])


def _wrong_sign(record: Record) -> str | None:
    """A motor at rest takes energy: from rest on, the sum of voltage times current is positive."""
    energy, scale = 0.0, 0.0
    for segment in record.segments:
        v, i = segment.voltage_axis_v[segment.is_good], segment.axis_current_a[segment.is_good]
        energy += float(v @ i)
        scale += float(np.linalg.norm(v) * np.linalg.norm(i))
    if energy < LEAST_POWER_FACTOR * scale:
        return "the currents flow against the voltage, as if a motor at rest gave power: turn the sign of one of them"
    return None


def _wrong_direction(record: Record) -> str | None:
    along, across = 0.0, 0.0
    for segment in record.segments:
        inverse = np.linalg.pinv(TO_PHASES[: record.facts.phases])
        vector = inverse @ segment.currents_a[:, segment.is_good]
        vector = vector - vector.mean(axis=1, keepdims=True)
        a, b = _direction(segment)
        along += float(((a * vector[0] + b * vector[1]) ** 2).sum())
        across += float(((a * vector[1] - b * vector[0]) ** 2).sum())
    if across > MOST_ACROSS**2 * along:
        return (
            "the current does not follow the excited axis (across it flows "
            f"{np.sqrt(across / max(along, 1e-300)):.0%} of what flows along it): a shaft that turns, phases in another "
            "order, or a wrong axis column; `commissioner monitor` reads a running motor"
        )
    return None
