"""What somebody who knows the answer would measure: each cause's strength, its twin, the gain on another excitation."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.diagnosis import Diagnosis
from commissioner.diagnose.export import playback as player
from commissioner.diagnose.fit.gauss_newton import fit
from commissioner.diagnose.intake.audit import prepare
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.search.nominal import bare_layout, from_segment_to_segment, nominal_fit
from sim.recordings.standstill import record
from sim.scenario import Scenario
from tests.hidden_effects.cases import class_of, other_excitation, recording_of, without_noise

BOUND_TO_THE_RECORDING = frozenset(
    [
        "mains_pickup",
        "dc_link_ripple",
        "sensor_drift",
        "sensor_switch_on",
        "remanence",
        "shaft_motion",
        "lost_samples",
        "clipping",
        "quantization",
    ]
)
"""Causes whose phase, start or place belongs to one recording: no model predicts them on the next one."""


def strength_sigma(scenario: Scenario, seed: int, names: list[str], noise: Noise) -> float:
    """Whitened rms error that the named effects alone leave after the four-parameter fit, without noise."""
    audited, _ = prepare([recording_of(without_noise(scenario, names), seed)])
    _, first = from_segment_to_segment(audited, nominal_fit(audited, noise).model, bare_layout(audited), noise)
    return float(np.sqrt(first.chi2 / first.normal.count.sum()))


def twin_margin(seen: Diagnosis, true_name: str) -> float | None:
    """Chi-square by which the true cause fits better than its best class-mate; None where it has none."""
    if seen.found is None or seen.noise is None or len(class_of(true_name)) == 1:
        return None
    found = seen.found
    chi2 = {}
    for name in sorted(class_of(true_name)):
        terms = CATALOGUE[name].terms(found.setting)
        if terms:
            model = found.nominal.model.with_terms(terms)
            chi2[name] = fit(model, found.record, found.layout, seen.noise).chi2
    rivals = [v for k, v in chi2.items() if k != true_name]
    if true_name not in chi2:
        return 0.0
    return min(rivals) - chi2[true_name] if rivals else 0.0


def gain_capture(seen: Diagnosis, scenario: Scenario, seed: int) -> float | None:
    """Share of the error power, on a noise-free recording with other phases and level, that the extended model removes.

    The oracle is the truth itself, with no error at all. None where a cause is bound to its recording.
    """
    names = {e.name for e in scenario.plant.effects}
    if seen.found is None or not names or names & BOUND_TO_THE_RECORDING:
        return None
    columns, _, _ = record(without_noise(other_excitation(scenario, seed)), seed)
    starts = np.flatnonzero(np.r_[True, np.diff(columns["segment"]) != 0, True])
    plan = [(float(columns["axis_deg"][a]), columns["voltage_axis_v"][a:b]) for a, b in itertools.pairwise(starts)]
    before, after = (_error_power(seen, which, plan, columns) for which in (seen.found.nominal, seen.found.fit))
    return 1.0 - after / before


def _error_power(
    seen: Diagnosis, one: Any, plan: list[tuple[float, np.ndarray]], truth: dict[str, np.ndarray]
) -> float:
    found = seen.found
    assert found is not None
    played = player.play(one.model, found.layout, found.record.facts, plan, found.setting.lines_hz)
    return float(sum(np.sum((played[f"current_{p}_a"] - truth[f"current_{p}_a"]) ** 2) for p in "uvw"))
