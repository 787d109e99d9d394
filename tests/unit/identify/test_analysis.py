"""From a recording to a result: the simulator's answer key, and named refusals for what cannot carry an answer."""

from __future__ import annotations

import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pytest

from commissioner.errors import ConfigurationError, DataRefused, UsageError
from commissioner.identify import analysis
from commissioner.identify.analysis import identify
from commissioner.identify.batch.whiteness import Whiteness
from commissioner.identify.document import document as identification_document
from commissioner.motor.nameplate import RatedFlux
from commissioner.records import StandstillRecording
from tests.support.standstill import linear_current, multitone

PERIOD_S = 2e-4
TRUTH = (3.7, 2.09, 0.021, 0.224)
TONES = [(14.0, 0.7, 0.0), (4.0, 2.3, 1.0), (12.0, 19.8, 2.0), (9.0, 60.1, 3.0)]
PLATE = {
    "rated_power_w": 2200.0,
    "rated_voltage_v": 400.0,
    "rated_frequency_hz": 50.0,
    "rated_current_a": 5.0,
    "rated_speed_rpm": 1436.0,
    "power_factor": 0.8,
    "pole_pairs": 2.0,
    "connection": "star",
}


def recording(tones=TONES, seconds=5.0, axis_deg=30.0, noise=0.01, seed=1, truth=TRUTH) -> StandstillRecording:
    voltage = multitone(tones, seconds, PERIOD_S)
    current = linear_current(truth, voltage, PERIOD_S)
    rng = np.random.default_rng(seed)
    phases = [
        current * np.cos(np.radians(axis_deg - shift)) + noise * rng.standard_normal(current.size)
        for shift in (0, 120, 240)
    ]
    n = voltage.size
    return StandstillRecording(
        np.arange(n) * PERIOD_S,
        np.zeros(n, dtype=np.int64),
        np.full(n, axis_deg),
        voltage,
        phases[0],
        phases[1],
        phases[2],
        None,
        PERIOD_S,
        PLATE,
    )


@pytest.mark.parametrize("estimator", ["pao", "nls", "lyapunov"])
def test_every_estimator_finds_the_machine(estimator):
    seconds = 40.0 if estimator == "lyapunov" else 5.0
    result = identify(recording(seconds=seconds), estimator=estimator)
    relative = np.abs(np.array(result.parameters.as_tuple()) / TRUTH - 1.0)
    assert np.all(relative < 0.01)
    assert np.all(relative * TRUTH < 4.5 * np.array(result.std))
    assert result.axes[0].whiteness.is_white
    assert result.inverter is None


def test_what_the_gradient_law_misses_of_least_squares_is_in_its_standard_errors():
    axis = identify(recording(seconds=10.0, noise=0.05), estimator="lyapunov").axes[0]
    apart = np.abs(np.array(axis.parameters.as_tuple()) - TRUTH)
    least_squares = np.sqrt(np.diag(axis.batch.inverse_gamma_at(axis.peak_stator_flux_wb)[1]))
    assert np.max(apart / least_squares) > 3.0
    assert np.all(apart < 2.5 * np.sqrt(np.diag(axis.covariance)))


def test_the_document_is_json_with_the_contracts_keys():
    document = identification_document(identify(recording()))
    again = json.loads(json.dumps(document, allow_nan=False))
    assert {
        "outcome",
        "reason",
        "parameters",
        "axes",
        "rated_flux_wb",
        "inverter",
        "gaps",
        "duration_s",
        "t_model",
    } <= set(again)
    assert set(again["parameters"]) == {
        "stator_resistance_ohm",
        "rotor_resistance_ohm",
        "leakage_inductance_h",
        "magnetizing_inductance_h",
        "rotor_time_constant_s",
    }
    assert again["t_model"]["assumption"]
    assert {"axis_deg", "parameters", "whiteness", "peak_rotor_flux_wb"} <= set(again["axes"][0])


def of_rows(whole, keep):
    columns = {name: column[keep] for name, column in vars(whole).items() if isinstance(column, np.ndarray)}
    return dataclasses.replace(whole, **columns)


def test_gaps_are_counted_and_leave_no_bias():
    whole = recording(seconds=8.0)
    keep = np.ones(whole.time_s.size, dtype=bool)
    keep[9000:9300] = keep[20000:20050] = False
    result = identify(of_rows(whole, keep))
    assert (result.gaps, result.lost_samples) == (2, 350)
    assert np.all(np.abs(np.array(result.parameters.as_tuple()) - TRUTH) < 4.5 * np.array(result.std))


def test_resistance_is_referred_to_20_degrees_where_a_temperature_is_known():
    result = identify(recording(), winding_temperature_degc=60.0)
    assert result.stator_resistance_20degc_ohm is not None
    assert result.stator_resistance_20degc_ohm[0] == pytest.approx(3.7 * 254.5 / 294.5, rel=0.01)


def test_default_drive_recording_from_the_simulator_meets_the_issues_target():
    """Real inverter, 12-bit sensors, saturating iron: three axes and a repeat, by the simulator's answer key.

    The winding warms by 1 % over these 64 s, so that the cold resistance of the key is compared with the first axis.
    """
    from sim.recordings.standstill import record
    from sim.scenario import load

    columns, metadata, truth = record(load("rich"), 3)
    result = identify(
        StandstillRecording(
            columns["time_s"],
            columns["segment"].astype(np.int64),
            columns["axis_deg"],
            columns["voltage_axis_v"],
            columns["current_u_a"],
            columns["current_v_a"],
            columns.get("current_w_a"),
            columns["dc_link_v"],
            float(metadata["sample_period_s"]),
            metadata,
        )
    )
    key = truth["inverse_gamma"]["over_flux"]
    names = ("stator_resistance_ohm", "rotor_resistance_ohm", "leakage_inductance_h", "magnetizing_inductance_h")
    flux = [row["stator_flux_wb"] for row in key]
    exact = np.array([np.interp(result.holds_for_flux_wb, flux, [row["secant"][n] for row in key]) for n in names])
    exact[0] = truth["apparent_stator_resistance_ohm"]
    found = np.array(result.parameters.as_tuple())
    warmest = result.axes[-1].parameters.stator_resistance_ohm
    found[0] = result.axes[0].parameters.stator_resistance_ohm
    relative = np.abs(found / exact - 1.0)
    assert np.all(relative < [0.005, 0.02, 0.01, 0.02]), relative
    assert found[0] < warmest < 1.015 * exact[0]


# -- refusals ------------------------------------------------------------------------------------------------------


def refused(broken: StandstillRecording, **options) -> DataRefused:
    with pytest.raises(DataRefused) as caught:
        identify(broken, **options)
    assert caught.value.exit_code == 3
    assert caught.value.remedy
    return caught.value


def changed(**columns) -> StandstillRecording:
    return dataclasses.replace(recording(), **columns)


def test_one_tone_is_refused_and_told_which_combination_it_fixes():
    error = refused(recording([(14.0, 5.0, 0.0)], noise=0.0))
    assert "one tone" in str(error)
    omega = 2 * np.pi * 5.0
    r_s, r_r, _l_sigma, l_m = TRUTH
    real = r_s + r_r * (omega * l_m) ** 2 / (r_r**2 + (omega * l_m) ** 2)
    number = float(error.remedy.split("= ")[1].split(" ohm")[0])
    assert number == pytest.approx(real, rel=0.02)


def test_short_nan_uneven_and_unexcited_recordings_are_refused_by_name():
    assert "short" in str(refused(recording(seconds=0.2)))
    good = recording()
    bad = good.current_u_a.copy()
    bad[77] = np.nan
    error = refused(changed(current_u_a=bad))
    assert "current_u_a" in str(error)
    assert "77" in str(error.value)
    time = good.time_s.copy()
    time[100:] += 0.4 * PERIOD_S
    assert "steps" in str(refused(changed(time_s=time)))
    assert "excited" in str(refused(changed(voltage_axis_v=np.zeros_like(good.time_s))))


def test_a_current_against_the_voltage_or_in_other_units_is_refused():
    good = recording()
    names = ("current_u_a", "current_v_a", "current_w_a")
    assert "does not follow" in str(refused(changed(**{n: -getattr(good, n) for n in names})))
    assert "nameplate" in str(refused(changed(**{n: 1e3 * getattr(good, n) for n in names})))
    for factor in (1e-3, 1e3):
        assert "voltages do not fit" in str(refused(changed(voltage_axis_v=factor * good.voltage_axis_v)))


def test_a_running_motor_is_refused():
    time = np.arange(15000) * PERIOD_S
    phases = {f"current_{k}_a": 7.0 * np.cos(314.0 * time - 2.094 * j - 0.6) for j, k in enumerate("uvw")}
    rows = {"time_s": time, "segment": np.zeros(15000, dtype=np.int64), "axis_deg": np.zeros(15000)}
    assert "rotates" in str(refused(changed(**rows, **phases, voltage_axis_v=300.0 * np.cos(314.0 * time))))
    assert "standstill" in str(refused(changed(metadata=PLATE | {"kind": "running"})))


def test_time_in_other_units_and_a_recording_in_shreds_are_refused():
    good = recording()
    assert "sample period" in str(refused(changed(time_s=1e3 * good.time_s)))
    keep = np.arange(good.time_s.size) % 50 != 0
    assert "pieces" in str(refused(of_rows(good, keep)))


def test_clipped_currents_are_refused_and_the_channel_named():
    good = recording(axis_deg=0.0)
    top = 0.8 * np.max(good.current_u_a)
    error = refused(dataclasses.replace(good, current_u_a=np.clip(good.current_u_a, -top, top)))
    assert "current_u_a is clipped" in str(error)


def test_a_channel_limited_before_its_noise_or_read_in_another_scale_leaves_a_sum_of_phases():
    good = recording()
    top = 0.6 * float(np.max(good.current_u_a))
    limited = np.clip(good.current_u_a, -top, top) + 0.01 * np.random.default_rng(2).standard_normal(good.time_s.size)
    assert "add up" in str(refused(dataclasses.replace(good, current_u_a=limited)))
    assert "add up" in str(refused(dataclasses.replace(good, current_u_a=1.1 * good.current_u_a)))


def test_samples_a_fifth_of_a_second_apart_are_refused():
    good = recording()
    slow = dataclasses.replace(good, time_s=1e3 * good.time_s, sample_period_s=1e3 * good.sample_period_s)
    assert "too far apart" in str(refused(slow))


def test_a_quantised_slow_sine_is_not_taken_for_clipping():
    tones = [(14.0, 0.7, 0.0), (3.0, 2.3, 1.0), (2.0, 11.8, 2.0), (1.0, 40.1, 3.0)]
    good = recording(tones, axis_deg=0.0, noise=0.0)
    lsb = 25.0 / 2048
    rounded = {n: np.round(getattr(good, n) / lsb) * lsb for n in ("current_u_a", "current_v_a", "current_w_a")}
    identify(dataclasses.replace(good, **rounded))


def test_a_wrong_axis_is_refused_with_the_one_that_was_seen():
    error = refused(changed(axis_deg=np.full(recording().time_s.size, 90.0)))
    assert "axis" in str(error)
    assert "30.0" in str(error.value)


def test_missing_and_impossible_nameplate_keys_are_named():
    assert "rated_current_a" in str(
        refused(changed(metadata={k: v for k, v in PLATE.items() if k != "rated_current_a"}))
    )
    with pytest.raises(ConfigurationError, match="rated_speed_rpm"):
        identify(changed(metadata=PLATE | {"rated_speed_rpm": 1600.0}))


def test_an_unknown_estimator_is_a_usage_error():
    with pytest.raises(UsageError):
        identify(recording(), estimator="ekf")  # type: ignore[arg-type]


def test_an_axis_that_changes_inside_a_segment_is_refused():
    axis = recording().axis_deg.copy()
    axis[5000:] = 60.0
    assert "changes its axis" in str(refused(changed(axis_deg=axis)))


def test_a_voltage_column_a_row_late_is_found_and_said():
    good = recording([*TONES, (14.0, 150.3, 0.5)])
    late = dataclasses.replace(good, voltage_axis_v=np.append(0.0, good.voltage_axis_v[:-1]))
    told, wanted = identify(late), identify(good)
    for value, true in zip(told.parameters.as_tuple(), wanted.parameters.as_tuple(), strict=True):
        assert value == pytest.approx(true, rel=2e-3)
    assert abs(identification_document(told)["time_shift_periods"]["value"]) == pytest.approx(1.0, abs=0.01)


def test_a_coarse_look_that_says_seven_periods_of_a_sound_test_is_no_refusal(monkeypatch):
    monkeypatch.setattr("commissioner.identify.analysis.periods_late", lambda *_: 7.4)
    found = identify(recording())
    assert found.time_shift.periods == 0
    assert found.parameters.as_tuple() == pytest.approx(TRUTH, rel=0.01)


def test_an_axis_some_degrees_off_is_refused_and_a_few_are_told():
    assert "named axis" in str(refused(changed(axis_deg=np.full(recording().time_s.size, 20.0))))
    result = identify(changed(axis_deg=np.full(recording().time_s.size, 26.0)))
    assert any("+4.0 deg beside axis_deg 26" in remark for remark in result.remarks)
    assert not any("beside" in remark for remark in identify(recording()).remarks)


def test_a_sweep_and_a_square_wave_are_not_one_tone():
    time = np.arange(25_000) * PERIOD_S
    for voltage in (25.0 * np.sin(2.0 * np.pi * (0.4 + 7.0 * time) * time), 14.0 * np.sign(np.sin(18.0 * time + 0.1))):
        current = linear_current(TRUTH, voltage, PERIOD_S)
        noise = 0.01 * np.random.default_rng(2).standard_normal((3, time.size))
        phases = [current * np.cos(np.radians(30.0 - shift)) for shift in (0, 120, 240)] + noise
        names = ("current_u_a", "current_v_a", "current_w_a")
        result = identify(changed(voltage_axis_v=voltage, **dict(zip(names, phases, strict=True))))
        assert np.array(result.parameters.as_tuple()) == pytest.approx(TRUTH, rel=0.01)


def test_noise_of_a_third_of_the_current_is_no_unbalanced_sum():
    result = identify(recording(noise=0.3))
    assert np.all(np.abs(np.array(result.parameters.as_tuple()) - TRUTH) < 4.0 * np.array(result.std))


def two_tests(seed=1):
    """One axis after the other in one recording."""
    first, second = recording(axis_deg=0.0, seed=seed), recording(axis_deg=60.0, seed=seed + 1)
    last = first.time_s[-1] + PERIOD_S
    columns = ("axis_deg", "voltage_axis_v", "current_u_a", "current_v_a", "current_w_a")
    return first, dataclasses.replace(
        first,
        time_s=np.concatenate([first.time_s, last + second.time_s]),
        segment=np.concatenate([first.segment, second.segment + 1]),
        **{name: np.concatenate([getattr(first, name), getattr(second, name)]) for name in columns},
    )


def test_a_fit_of_the_same_samples_is_taken_over_and_changes_no_bit():
    first, whole = two_tests()
    look = identify(first, estimator="nls", is_final=False)
    anew, taken_over = identify(whole), identify(whole, earlier=look)
    assert taken_over.fits[0] is look.fits[0]
    assert anew.parameters == taken_over.parameters
    assert np.array_equal(anew.covariance, taken_over.covariance)


def test_a_fit_of_other_samples_is_not_taken_over():
    _, whole = two_tests()
    look = identify(recording(axis_deg=0.0, seed=7), estimator="nls", is_final=False)
    assert identify(whole, earlier=look).parameters == identify(whole).parameters


@pytest.mark.parametrize(("statistic", "shown"), [(20.13, "(20.13, limit 20.1)"), (26.4, "(26, limit 20.1)")])
def test_what_is_beyond_a_limit_does_not_look_as_if_it_were_within(statistic, shown):
    result = SimpleNamespace(
        axis_deg=0.0, disagreement_sigmas=0.0, whiteness=Whiteness(statistic), residual_rms_a=1.0, turning_rad_per_s=0.0, held_back=None,
        batch=SimpleNamespace(residuals=[np.random.default_rng(1).normal(size=1000)]),
    )  # fmt: skip
    said = analysis._remarks([result], RatedFlux(0.7, 1.0), 0.5, 0.5)
    assert any(shown in remark for remark in said)
