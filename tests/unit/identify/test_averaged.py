"""Samples that are means over several control periods say what the samples themselves say."""

import numpy as np
import pytest

from commissioner.errors import DataRefused
from commissioner.identify.analysis import identify
from commissioner.identify.intake.averaged import on_its_period, running_mean_v
from commissioner.motor.nameplate import Nameplate
from commissioner.recordings.table import read_table, to_standstill
from commissioner.records import StandstillRecording
from tests.support.standstill import linear_current, multitone

PERIOD_S = 2e-4
TRUTH = (3.72, 2.19, 0.0215, 0.309)
PLATE = Nameplate(2200.0, 400.0, 50.0, 5.0, 1430.0, 0.8, 2, "star")
TONES = [(18.0, 0.8, 0.0), (14.0, 4.3, 1.1), (22.0, 9.0, 2.3), (25.0, 20.5, 0.4)]


def _recorded(averaged: tuple[int, ...], noise_a: float = 0.0) -> StandstillRecording:
    """One segment for each number of periods averaged, from rest, the amplitude ramped; exact held-voltage currents."""
    rng = np.random.default_rng(7)
    columns: dict[str, list[np.ndarray]] = {name: [] for name in ("time", "segment", "voltage", "current", "in_row")}
    for segment, n in enumerate(averaged):
        voltage = multitone(TONES, 4.2, PERIOD_S)
        voltage *= np.minimum(np.arange(voltage.size) * PERIOD_S / 0.2, 1.0)
        current = linear_current(TRUTH, voltage, PERIOD_S) + noise_a * rng.standard_normal(voltage.size)
        rows = voltage.size // n
        columns["time"].append(10.0 * segment + np.arange(rows) * n * PERIOD_S)
        columns["segment"].append(np.full(rows, segment))
        columns["voltage"].append(voltage[: rows * n].reshape(rows, n).mean(axis=1))
        columns["current"].append(current[: rows * n].reshape(rows, n).mean(axis=1))
        columns["in_row"].append(np.full(rows, n))
    of = {name: np.concatenate(parts) for name, parts in columns.items()}
    return StandstillRecording(
        of["time"], of["segment"], np.zeros(of["time"].size), of["voltage"], of["current"], -0.5 * of["current"], None, None,
        PERIOD_S, averaged=of["in_row"],
    )  # fmt: skip


@pytest.mark.parametrize("averaged", [(5,), (12,), (3, 12)])
def test_means_give_the_parameters_exactly(averaged):
    found = identify(_recorded(averaged, noise_a=1e-5), PLATE, "nls").parameters.as_tuple()
    assert np.array(found) == pytest.approx(TRUTH, rel=3e-4)


@pytest.mark.parametrize("estimator", ["pao", "nls"])
def test_standard_errors_of_means_are_honest(estimator):
    found = identify(_recorded((5, 5), noise_a=0.05), PLATE, estimator)
    off = (np.array(found.parameters.as_tuple()) - TRUTH) / found.std
    assert np.max(np.abs(off)) < 3.0
    assert np.max(np.array(found.std) / TRUTH) < 0.01


def test_means_taken_for_samples_move_the_leakage_by_what_they_lie_off():
    """The check of the checks above: half a row of delay is not hidden by anything."""
    as_means = _recorded((5,), noise_a=1e-5)
    as_samples = StandstillRecording(
        as_means.time_s, as_means.segment, as_means.axis_deg, as_means.voltage_axis_v, as_means.current_u_a,
        as_means.current_v_a, None, None, 5 * PERIOD_S,
    )  # fmt: skip
    leakage_h = identify(as_samples, PLATE, "nls").parameters.leakage_inductance_h
    assert abs(leakage_h / TRUTH[2] - 1.0) > 1e-3


def test_a_running_mean_is_that_of_the_voltage_within_a_thousandth():
    n = 5
    voltage = multitone(TONES, 1.0, PERIOD_S)
    means = voltage.reshape(-1, n).mean(axis=1)
    exact = np.convolve(voltage, np.full(n, 1.0 / n), "valid")
    seen = running_mean_v(means, n)
    assert np.max(np.abs(seen - exact)[5 * n : -5 * n]) < 1e-3 * np.max(np.abs(exact))
    assert seen[::n] == pytest.approx(means, abs=1e-9)


def test_a_voltage_that_stands_still_stays_as_it_is_between_rows():
    means = np.array([0.0, 0.0, 0.0, 1.0, 4.0, 4.0, 4.0, 4.0, 4.0, 4.0, 4.0, 4.0])
    inside = running_mean_v(means, 4)
    assert np.all(inside[4 * 8 :] == 4.0)
    assert np.array_equal(on_its_period(means, 1), means)


def test_a_column_of_periods_that_changes_inside_a_segment_is_refused(tmp_path):
    path = tmp_path / "means.csv"
    rows = "\n".join(f"{k * 2e-4:.4f},0,0,1,1,-0.5,{2 if k < 5 else 3}" for k in range(10))
    path.write_text(
        "# sample_period_s: 0.0001\ntime_s,segment,axis_deg,voltage_axis_v,current_u_a,current_v_a,averaged_periods\n"
        + rows,
        "utf-8",
    )
    with pytest.raises(DataRefused, match="averaged_periods"):
        to_standstill(read_table(path))
