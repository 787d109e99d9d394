"""The nominal stage: where the four parameters can be, their fit, what is left of one segment at the start of the next,
and the dictionaries scaled to what the fitted machine reaches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.causes.inverter.legs import lost_by_a_leg
from commissioner.diagnose.causes.regressors import add_channels
from commissioner.diagnose.causes.setting import Setting
from commissioner.diagnose.fit.gauss_newton import Fit, fit
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.intake.record import Record, each_segment
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.plant.channel_end import channel_ends
from commissioner.diagnose.plant.flux_before import with_flux_before
from commissioner.diagnose.plant.impedance import impedance_starts
from commissioner.diagnose.plant.model import LEG_TAIL, NO_DICTIONARY, Layout, Model, Term, even_vectors, odd_vectors
from commissioner.diagnose.plant.prediction import predict

Array = NDArray[np.float64]
CORNERS_HZ, EDDY_CORNERS_HZ = 12.5 * 2.0 ** (2.0 / 3.0 * np.arange(10)), np.array([150.0, 400.0, 1000.0])
"""Of rotor branches, two thirds of an octave apart, and of eddy-current paths of the iron."""
BRANCH_TIME_S = 1.0 / (2.0 * np.pi * np.r_[CORNERS_HZ, -EDDY_CORNERS_HZ])
AT_AN_END = 1e-3
"""Of a number, by which it may miss the end of its box."""
MOST_LEAK_RATIO = 0.35
"""Of L_sigma over L_M: no more is believed where L_M is hardly seen."""
DROP_SHARE, TAIL_SHARE, LEAST_SLACK = 0.003, 0.03, 0.03
"""Rise at one knot of a leg's tail, over the voltage across R_s at the peak and over the leg's loss before the tail; and the least, over
the first. A slack as large as the loss let the tail take 15 to 27 % more than there was, off R_s, for rises cannot be negative.
"""
STOP_SHARES = (0.01, 0.025, 0.06, 0.14, 0.3, 0.6, -0.03, -0.1, -0.3)
WIDENING, NARROWING = (-0.03, -0.1, -0.3), (0.03, 0.1, 0.25, 0.5)
"""Radii of stops and, negative, scales of exponential operators, over the largest iron flux; those whose loops widen, and narrow."""


def layout_for(record: Record, model: Model) -> tuple[Layout, float]:
    """Dictionaries scaled to the currents and fluxes the model reaches on this record; and the largest iron flux."""
    bare = bare_layout(record)
    flux, _ = largest_fluxes(record, model, bare)
    peak = record.facts.current_peak_a
    knee = 0.004 * peak
    layout = replace(
        with_ranges(bare, flux, peak * model.nominal[2]),
        legs_top=float(np.arcsinh(0.6 * peak / knee)),
        legs_knee_a=knee,
        legs_vectors=odd_vectors(16),
        iron_vectors=even_vectors(10),
        leak_vectors=even_vectors(12),
        branch_time_s=BRANCH_TIME_S,
        nonlinearity_scale_a=2.0 * record.facts.rated_current_peak_a,
        channel_ends_a=channel_ends(record),
        leak_ratio=leak_ratio(model),
    )
    return replace(layout, legs_slack_v=legs_slack_v(model, layout, peak)), flux


def leak_ratio(model: Model) -> float:
    """Of the leakage over the magnetizing inductance."""
    return min(model.nominal[2] / model.nominal[3], MOST_LEAK_RATIO)


def legs_slack_v(model: Model, layout: Layout, peak_a: float) -> float:
    """By how much a leg's loss may rise at each knot of its tail: a small part of what it loses before, where a leg's loss is known;
    else of the voltage across R_s, as which more would pass.
    """
    most = DROP_SHARE * peak_a * model.nominal[0]
    lost = lost_by_a_leg(model, layout, LEG_TAIL)
    return min(max(TAIL_SHARE * lost, LEAST_SLACK * most), most) if lost > 0.0 else most


def largest_fluxes(record: Record, model: Model, layout: Layout) -> tuple[float, float]:
    """Of the iron and of the leakage path (Wb)."""

    def of_segment(k: int) -> tuple[float, float]:
        seen = predict(model, record, k, layout)
        return float(np.hypot(*seen.iron_flux_wb).max()), float(np.hypot(*seen.leakage_flux_wb).max())

    iron, leakage = zip(*each_segment(of_segment, record), strict=True)
    return max(iron), max(leakage)


def with_ranges(layout: Layout, iron_flux_wb: float, leakage_flux_wb: float) -> Layout:
    """The dictionaries of iron and leakage spread over the largest fluxes reached, with a margin."""
    return replace(
        layout,
        iron_top_wb=1.08 * iron_flux_wb,
        leak_top_wb=1.2 * leakage_flux_wb,
        stop_radius_wb=np.array(
            [
                *((share * iron_flux_wb, 0.0) for share in STOP_SHARES),
                *((share * iron_flux_wb, iron_flux_wb**-2.0) for share in WIDENING),
                *((share * iron_flux_wb, -(iron_flux_wb**-2.0)) for share in NARROWING),
            ]
        ),
    )


def bare_layout(record: Record) -> Layout:
    """No dictionary yet, only where the four parameters can be: around what the impedance at the tones says. The reactance of
    a single slow tone is the magnetizing inductance's for the most part.
    """
    stator, rotor, leakage, _ = impedance_starts(record)[0]
    total = stator + rotor
    return replace(
        NO_DICTIONARY,
        nominal_box=(
            (0.01 * total, 4.0 * total),
            (0.01 * total, 6.0 * total),
            (0.02 * leakage, 4.0 * leakage),
            (0.3 * leakage, 1e3 * leakage),
        ),
    )


def nominal_fit(record: Record, noise: Noise) -> Fit:
    """The four-parameter output-error fit, from the best of the starts."""
    bare = bare_layout(record)
    fits = [fit(Model(start), record, bare, noise, rounds=15, tolerance=1.0) for start in impedance_starts(record)]
    return min(fits, key=lambda f: f.chi2)


def from_segment_to_segment(record: Record, start: Model, bare: Layout, noise: Noise) -> tuple[Record, Fit]:
    """The four parameters on all of the record, with unknown starts and the flux that a segment inherits from the one before."""
    nominal = fit(start, record, bare, noise, rounds=6, tolerance=1.0)
    unknown_starts = starts_of(record)
    if unknown_starts:
        nominal = fit(nominal.model.with_terms(unknown_starts), record, bare, noise, rounds=8, tolerance=1.0)
    if len(record.segments) > 1:
        record = with_flux_before(record, nominal.model, bare)
        nominal = fit(nominal.model.with_terms(CARRY), record, bare, noise, rounds=6, tolerance=1.0)
        record = with_flux_before(record, nominal.model, bare)
        nominal = fit(nominal.model, record, bare, noise, rounds=6, tolerance=1.0)
    return record, nominal


CARRY = (
    Term("", "flux_carried_over", "1", kinds.CARRY, 0, 0.01, -1.0, 1.0),
    Term("", "flux_carried_over_turned", "1", kinds.CARRY, 1, 0.01, -1.0, 1.0),
)
"""Nuisances of the nominal model: how much of the rotor flux outlives the pause between two segments, and what a shaft
that turns meanwhile makes of its direction."""


def is_outside_the_box(model: Model, layout: Layout) -> bool:
    """Whether the four numbers are no motor's: one at an end of where it may be, or less magnetizing inductance than leakage."""
    box, four = np.array(layout.nominal_box), np.array(model.nominal)
    return bool(
        (four <= (1.0 + AT_AN_END) * box[:, 0]).any()
        or (four >= (1.0 - AT_AN_END) * box[:, 1]).any()
        or four[3] < four[2]
    )


def starts_of(record: Record) -> list[Term]:
    """Nuisances of the nominal model: stator and rotor flux at the start of every stretch that follows a hole."""
    return [
        Term("", f"start_{c}_{s.uid}", "Wb", kinds.INITIAL_FLUX, 2 + c, 0.01, segment=s.uid)
        for s in record.segments
        if not s.starts_at_rest
        for c in range(4)
    ]


def set_up(record: Record, noise: Noise, nominal: Fit) -> tuple[Record, Layout, Setting]:
    layout, flux = layout_for(record, nominal.model)
    record, lines = add_channels(record, nominal.model, layout, noise)
    return (
        record,
        layout,
        Setting(
            record, layout, flux, record.facts.current_peak_a * nominal.model.nominal[2], nominal.model.nominal, lines
        ),
    )
