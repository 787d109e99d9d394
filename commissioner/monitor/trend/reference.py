"""Against an encoder, where the recording has one: for checking only, never an input."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from commissioner.monitor.chain import Observation
from commissioner.monitor.contract import State
from commissioner.monitor.machine.inversion import basis_of
from commissioner.monitor.signals.supply import Vector
from commissioner.motor.circuit import Quantity
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
    said = Quantity(observation.mean_speed_rad_per_s, observation.mean_speed_std)
    return {
        **_of_means(speed, said),
        "ripple_rms_rad_per_s": amplitude,
        "ripple_relative_error": error / amplitude if amplitude > 0 else float("nan"),
        "ripple_error_in_std": error / float(np.sqrt(np.mean(observation.period.speed_std**2))),
    }


def beside_column(
    recording: RunningRecording, stretches: Sequence[State], said: Quantity | None
) -> dict[str, float] | None:
    """What the speed column reads over the stretch that a partial answer is of, and how far `said` is from it; None without one."""
    if recording.speed_rad_per_s is None:
        return None
    time = recording.time_s - recording.time_s[0]
    used = next(((s["start_s"], s["end_s"]) for s in stretches if s["used"]), (0.0, float(time[-1])))
    speed = recording.speed_rad_per_s[(time >= used[0]) & (time <= used[1])]
    speed = speed[np.isfinite(speed)]
    return _of_means(speed, said) if speed.size else None


def _of_means(speed: Signal, said: Quantity | None) -> dict[str, float]:
    """Mean of the column; `said` less it, of it and in standard deviations of `said`. Of a shaft that stands there is no share."""
    mean = float(speed.mean())
    out = {"mean_speed_rad_per_s": mean}
    if said is not None and said.std > 0.0 and mean != 0.0:
        out["mean_speed_relative_error"] = said.value / mean - 1.0
        out["mean_speed_error_in_std"] = (said.value - mean) / said.std
    return out


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
