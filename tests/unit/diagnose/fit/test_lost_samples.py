"""Samples that vanished without a gap in the time stamps, of a record whose machine is known."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.diagnose.diagnosis import diagnose
from commissioner.diagnose.fit.gauss_newton import fit
from commissioner.diagnose.fit.lost_samples import _delay_step, mend
from commissioner.diagnose.intake.audit import prepare
from commissioner.diagnose.intake.noise import measure_noise
from commissioner.diagnose.plant.prediction import predict
from commissioner.diagnose.search.journal import followed
from commissioner.diagnose.search.search import _mended
from commissioner.diagnose.search.state import Problem
from tests.unit.diagnose.conftest import recording

NOISE_A = 2e-3


def skipped(rows, at):
    """(3, n) rows that are early by one more sample from each place on; the end is held."""
    places = np.arange(rows.shape[1]) + np.searchsorted(np.sort(at), np.arange(rows.shape[1]), side="right")
    return rows[:, np.minimum(places, rows.shape[1] - 1)]


def record_with(nominal, setting, change):
    random = np.random.default_rng(3)
    segments = []
    for k, s in enumerate(setting.record.segments):
        rows = change(k, predict(nominal, setting.record, k, setting.layout).currents_a)
        segments.append(replace(s, currents_a=rows + NOISE_A * random.standard_normal(rows.shape)))
    return replace(setting.record, segments=tuple(segments))


@pytest.mark.parametrize("is_first", [True, False])
def test_many_skips_of_the_current_channel_are_found_at_once(nominal, setting, is_first):
    """Seven in one second, two of them ten samples apart; each within two samples of its place, for noise hides it."""
    at = np.array([1400, 1900, 2200, 2210, 3000, 4100, 5000])
    record = record_with(nominal, setting, lambda k, rows: skipped(rows, at) if k == 1 else rows)
    mended, losses = mend(record, nominal, setting.layout, measure_noise(record), is_first=is_first)
    assert {x.way for x in losses} == {"current samples"} and sum(x.samples for x in losses) == at.size
    period = record.facts.sample_period_s
    found = np.concatenate([[round((x.time_s - record.segments[1].time_s[0]) / period)] * x.samples for x in losses])
    assert np.abs(np.sort(found) - at).max() <= 12  # samples; where the current is at its crest, a skip hardly shows
    left = mended.segments[1].currents_a - predict(nominal, mended, 1, setting.layout).currents_a
    assert np.std(left[:, mended.segments[1].is_good]) < 1.15 * NOISE_A


@pytest.mark.parametrize("phases", [2, 3])
def test_samples_lost_before_the_first_one_of_a_segment_are_found(nominal, setting, phases):
    """The command begins at once, so that the whole current of one segment is early beside the others'; one more is lost later."""
    source = recording(axes=(0.0, 60.0, 120.0, 0.0, 0.0))
    since = source.time_s % 2.2  # s, from the start of the segment
    command = sum(volts * np.sin(2.0 * np.pi * hz * since) for hz, volts in ((2.3, 14.0), (41.9, 20.0), (331.7, 30.0)))
    begun = replace(source, voltage_axis_v=command)
    record, _ = prepare([begun])
    rows = [predict(nominal, record, k, setting.layout).currents_a for k in range(5)]
    rows[1], rows[3] = skipped(rows[1], [0, 0]), skipped(rows[3], [3000])
    currents = np.concatenate(rows, axis=1)
    u, v, w = currents + NOISE_A * np.random.default_rng(3).standard_normal(currents.shape)
    seen = diagnose([replace(begun, current_u_a=u, current_v_a=v, current_w_a=w if phases == 3 else None)])
    assert [c.name for c in seen.causes] == ["lost_samples"] and seen.verdict == "explained"
    assert [(x.segment, x.samples) for x in seen.found.losses] == [(1, 2), (3, 1)]


@pytest.mark.parametrize("ppm", [100.0, 300.0])
def test_a_clock_that_runs_fast_is_not_a_staircase_of_losses(nominal, setting, ppm):
    """By nearly two samples within a segment."""

    def early(k, rows):
        t = np.arange(rows.shape[1])
        return np.stack([np.interp(t * (1.0 + 1e-6 * ppm), t, row) for row in rows])

    record = record_with(nominal, setting, early)
    seen = diagnose([recording(currents=np.concatenate([s.currents_a for s in record.segments], axis=1))])
    assert [c.name for c in seen.causes] == ["clock_drift"]


def test_a_whole_record_loses_nothing(nominal, setting):
    record = record_with(nominal, setting, lambda k, rows: rows)
    mended, losses = mend(record, nominal, setting.layout, measure_noise(record), is_first=True)
    assert losses == () and all(a is b for a, b in zip(mended.segments, record.segments, strict=True))


def test_held_samples_are_put_right_though_the_noise_was_measured_low(nominal, setting):
    """Noise too low adds as much misfit as seven held samples: within its stated doubt, or as if something else were there."""
    rows = predict(nominal, setting.record, 1, setting.layout).currents_a
    step = np.abs(np.diff(rows, axis=1, prepend=rows[:, :1])).max(axis=0)
    held = np.flatnonzero((step > 35.0 * NOISE_A) & (step < 50.0 * NOISE_A))[::8][:7]

    def change(k, rows):
        if k == 1:
            rows[:, held] = rows[:, held - 1]
        return rows

    record, noise = (
        record_with(nominal, setting, change),
        measure_noise(record_with(nominal, setting, lambda k, rows: rows)),
    )
    true = fit(nominal, record, setting.layout, noise)
    excess = true.chi2 / float(true.normal.count.sum()) - 1.0
    low = replace(noise, sigma_a=noise.sigma_a / np.sqrt(1.0 + excess), uncertainty=excess)
    current = fit(nominal, record, setting.layout, low)
    losses = followed(_mended(record, current, setting.layout, Problem(low, ())))[2]
    assert sum(x.samples for x in losses) == held.size
    assert followed(_mended(record, current, setting.layout, Problem(replace(low, uncertainty=0.0), ())))[2] == ()


def with_spikes(rows, random):
    """Six samples of one phase each, and one of two in a row, that stand out by 15 and more times the noise."""
    at, phase = random.integers(100, rows.shape[1] - 100, 6), random.integers(0, 3, 6)
    rows[phase, at] += NOISE_A * random.choice([-15.0, 15.0, 30.0], 6)
    rows[1, 9500:9502] += 30.0 * NOISE_A


def with_holds_and_spikes(rows, random):
    with_spikes(rows, random)
    held = np.array([2000, 8000, 8400])
    rows[:, held] = rows[:, held - 1]


def with_heavy_tails(rows, random):
    """Student's noise of three degrees of freedom beside the normal one: a few samples of a recording are 15 times its rms."""
    rows += NOISE_A * random.standard_t(3.0, rows.shape)


@pytest.mark.parametrize(("change", "held"), [(with_spikes, 0), (with_heavy_tails, 0), (with_holds_and_spikes, 3)])
@pytest.mark.parametrize("phases", [2, 3])
def test_of_samples_that_stand_out_only_those_are_lost_that_repeat_others(nominal, setting, change, held, phases):
    record, random = record_with(nominal, setting, lambda k, rows: rows), np.random.default_rng(11)
    rows = np.concatenate([s.currents_a for s in record.segments], axis=1)
    change(rows, random)
    seen = diagnose([replace(recording(currents=rows), current_w_a=rows[2] if phases == 3 else None)])
    assert [c.name for c in seen.causes] == ["lost_samples"] * bool(held)
    assert {(x.samples, x.way) for x in seen.found.losses} <= {(1, "held value")} and len(seen.found.losses) == held
    assert len(seen.found.spikes) > 2 and any("spikes" in remark for remark in seen.remarks)
    assert seen.verdict == ("explained" if held else "nothing_significant")


def test_a_value_held_for_long_is_lost_throughout(nominal, setting):
    record = record_with(nominal, setting, lambda k, rows: rows)
    rows = np.concatenate([s.currents_a for s in record.segments], axis=1)
    rows[:, 8000:8008] = rows[:, [7999]]
    seen = diagnose([recording(currents=rows)])
    assert [(x.samples, x.way) for x in seen.found.losses] == [(1, "held value")] * 8 and seen.found.spikes == ()


def test_where_nothing_moves_no_loss_is_looked_for():
    """A piece between two holes without a command: it had ended in a singular matrix."""
    assert _delay_step(np.ones((3, 300)), np.zeros((3, 300))) is None
    assert _delay_step(np.ones((3, 300)), np.eye(1, 300, 40).repeat(3, axis=0)) is None
