"""Against an encoder, where the recording has one: for checking only, never an input."""

from __future__ import annotations

import numpy as np

from commissioner.monitor.chain import Observation
from commissioner.monitor.machine.inversion import basis_of
from commissioner.monitor.signals.supply import Vector
from commissioner.records import RunningRecording, Signal


def against_encoder(observation: Observation, recording: RunningRecording) -> dict[str, float] | None:
    """Mean speeds over the same stretch and the ripple's difference after the same averaging; None without a column.

    The encoder's speed is projected on the same combs over the segment (and on the even mains harmonics, which are dropped).
    """
    if recording.speed_rad_per_s is None:
        return None
    audited, frame, part = observation.audited, observation.frame, observation.part
    speed = recording.speed_rad_per_s[audited.first_sample : audited.first_sample + audited.current_a.size]
    good = np.isfinite(speed)
    if not good.all():
        return None
    time = np.arange(speed.size) * audited.sample_period_s
    segment = frame.time_s[part]
    sampled = np.interp(segment, time, speed)
    own, encoder = _lines(observation, sampled, segment)
    amplitude = float(np.sqrt(2 * np.sum(np.abs(encoder) ** 2)))
    error = float(np.sqrt(2 * np.sum(np.abs(own - encoder) ** 2)))
    return {
        "mean_speed_rad_per_s": float(speed.mean()),
        "mean_speed_relative_error": float(observation.mean_speed_rad_per_s / speed.mean() - 1),
        "ripple_rms_rad_per_s": amplitude,
        "ripple_relative_error": error / amplitude if amplitude > 0 else float("nan"),
    }


def _lines(observation: Observation, sampled: Signal, segment: Signal) -> tuple[Vector, Vector]:
    problem = observation.problem
    phases = {p: comb.phase_rad for p, comb in enumerate(observation.combs)}
    basis = basis_of(problem.lines, phases, segment.size)
    mains = np.exp(1j * np.outer(observation.frame.supply_angle_rad[observation.part], [2, -2, 4, -4, 6, -6]))
    window = np.hanning(segment.size)[:, None]
    both = np.concatenate([basis, mains], axis=1) * window
    gram = np.conj(both.T) @ both
    amplitude = np.linalg.solve(
        gram + 1e-12 * np.trace(gram).real * np.eye(gram.shape[0]), np.conj(both.T) @ (sampled * window[:, 0])
    )
    return observation.solved.speed.amplitude_rad_per_s, amplitude[: basis.shape[1]][problem.on.positive]
