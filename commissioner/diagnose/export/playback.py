"""A motor, plain or extended by a diagnosis, played into the columns of a standstill recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.causes.regressors import FINE_SPEED_SPLINE, with_fine_speed_splines, with_known
from commissioner.diagnose.intake.record import Facts, Record, Segment
from commissioner.diagnose.plant.flux_before import with_flux_before
from commissioner.diagnose.plant.model import NO_DICTIONARY, Layout, Model, impedance
from commissioner.diagnose.plant.prediction import predict

Array = NDArray[np.float64]
TONES_HZ = (0.5, 2.3, 9.7, 41.9, 113.3, 331.7)
CURRENT_SHARES = (0.3, 0.25, 0.2, 0.2, 0.12, 0.08)
"""Tone currents over rated peak; sums to less than 1.2 with random phases."""
BIAS_SHARE = 0.4
PAUSE_S = 2.0


@dataclass(frozen=True)
class Test:
    """One segment of a plan: axis, level (1 = the tone currents above) and DC bias on or off."""

    axis_deg: float
    level: float
    has_bias: bool


def default_plan(axes_deg: Sequence[float] = (0.0, 60.0, 120.0)) -> tuple[Test, ...]:
    """Every axis at full level, the first at a third with bias and without, the first repeated last."""
    first = axes_deg[0]
    return (
        *(Test(a, 1.0, False) for a in axes_deg),
        Test(first, 0.35, False),
        Test(first, 0.35, True),
        Test(first, 1.0, False),
    )


def command(model: Model, facts: Facts, plan: Sequence[Test], seconds: float, seed: int) -> list[tuple[float, Array]]:
    """(axis, voltage) of every segment: half a second of zero, a ramp, then the multisine; phases from `seed`."""
    period = facts.sample_period_s
    t = np.arange(round(seconds / period)) * period
    phases = np.random.default_rng(seed).uniform(-np.pi, np.pi, len(TONES_HZ))
    tones = np.zeros(t.shape[0])
    for f, share, phase in zip(TONES_HZ, CURRENT_SHARES, phases, strict=True):
        flux_limit = 0.25 * facts.rated_flux_wb * 2.0 * np.pi * f if facts.rated_flux_wb else np.inf
        ohms = float(np.abs(impedance(model.nominal, np.array(f))))
        tones += min(share * facts.rated_current_peak_a * ohms, flux_limit) * np.cos(2 * np.pi * f * t + phase)
    ramp = np.clip((t - 0.5) / 0.3, 0.0, 1.0)
    bias = BIAS_SHARE * facts.rated_current_peak_a * model.nominal[0]
    return [(test.axis_deg, ramp * (test.level * tones + bias * test.has_bias)) for test in plan]


def play(
    model: Model,
    layout: Layout | None,
    facts: Facts,
    segments: Sequence[tuple[float, Array]],
    lines_hz: Mapping[str, float],
    noise_a: float = 0.0,
    seed: int = 0,
) -> dict[str, Array]:
    """Columns of the contract's standstill table. Heat and lagged power follow the model's own currents; of a speed or a line what
    these segments are too short for, or not there for, is left out. IndexError where a number points beyond its dictionary.
    """
    record = _blank(facts, segments)
    used = layout or NO_DICTIONARY
    plain = Model(model.nominal)
    record = with_flux_before(_filled(record, plain, used), plain, used)
    for _ in range(2):
        rotor = [predict(plain, record, k, used).rotor_current_a for k in range(len(record.segments))]
        known = with_known(replace(record, channel_names=(), channels=()), rotor, lines_hz)
        if any(t.channel.startswith(FINE_SPEED_SPLINE) for t in model.terms):
            known = with_fine_speed_splines(known, lines_hz)
        model = model.on_channels(known.channel_names)
        record = _filled(with_flux_before(known, model, used), model, used)
    noise = np.random.default_rng(seed + 1)
    parts = [
        {
            "time_s": s.time_s,
            "segment": np.full(s.count, float(s.number)),
            "axis_deg": np.full(s.count, s.axis_deg),
            "voltage_axis_v": s.voltage_axis_v,
            **{
                f"current_{p}_a": row + noise_a * noise.standard_normal(s.count)
                for p, row in zip("uvw", s.currents_a, strict=True)
            },
        }
        for s in record.segments
    ]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _blank(facts: Facts, segments: Sequence[tuple[float, Array]]) -> Record:
    out, start = [], 0.0
    for number, (axis, voltage) in enumerate(segments):
        n = voltage.shape[0]
        out.append(
            Segment(
                number,
                0,
                axis,
                np.asarray(start + np.arange(n) * facts.sample_period_s, dtype=np.float64),
                voltage,
                np.zeros((3, n)),
                np.ones(n, dtype=bool),
                np.ones(n),
                True,
                number,
                age_s=start,
            )
        )
        start += n * facts.sample_period_s + PAUSE_S
    return Record(tuple(out), replace(facts, phases=3))


def _filled(record: Record, model: Model, layout: Layout) -> Record:
    """The record with the model's currents in place of measured ones."""
    segments = tuple(
        replace(s, currents_a=predict(model, record, k, layout).currents_a) for k, s in enumerate(record.segments)
    )
    return replace(record, segments=segments)
