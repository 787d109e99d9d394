"""Windows of a running recording: where they begin, what they are, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.errors import DataRefused
from commissioner.estimation.checks import MONITORED_RATE, MONITORED_S
from commissioner.estimation.record import OPENING_S, STATES, between, negative_sequence, prepare
from commissioner.monitor.intake import clock
from commissioner.motor.channels.spikes import noise_of
from commissioner.motor.nameplate import Nameplate
from commissioner.motor.running import from_nameplate, stator_impedance
from commissioner.records import RunningRecording
from tests.running_effects.cases import Case, taken
from tests.running_effects.start import PLATE, started


@pytest.fixture(scope="module")
def start():
    recording, plate, _ = taken(Case(5000, "null").scenario(), 5000)
    return recording, plate


def test_a_window_begins_one_sample_after_closing_at_rest(start):
    recording, plate = start
    (window,) = prepare([recording], plate).windows
    skipped = recording.time_s.size - window.count
    volts = np.abs(np.array(recording.voltages_v))
    assert volts[:, : skipped - 2].max() < 0.05 * plate.rated_voltage_v
    assert volts[:, skipped].max() > 0.05 * plate.rated_voltage_v
    assert window.is_from_rest
    assert {STATES[k] for k in np.unique(window.state)} == {"start", "steady", "transient"}


def test_noise_is_measured_beside_harmonics():
    t = np.arange(10_000) * 2e-4
    rng = np.random.default_rng(1)
    x = (
        10.0 * np.sin(314 * t)
        + 0.3 * np.sin(5 * 314 * t)
        + 0.2 * np.sin(7 * 314 * t)
        + 0.02 * rng.standard_normal(t.size)
    )
    assert noise_of(x) == pytest.approx(0.02, rel=0.05)


def test_between_samples_a_harmonic_is_met():
    t = np.arange(400) * 2e-4
    fine = 0.5e-4 * 2 * np.arange(2 * t.size - 1)
    assert np.abs(between(np.sin(314 * t))[3:-3] - np.sin(314 * fine)[3:-3]).max() < 2e-6


def test_phases_that_turn_against_each_other_are_refused(start):
    recording, plate = start
    u, v, w = recording.currents_a
    with pytest.raises(DataRefused, match="turn against each other"):
        prepare([replace(recording, currents_a=(u, w, v))], plate)


def on_axes(x):
    return tuple((x * np.exp(-2j * np.pi * k / 3)).real for k in range(3))


def idle(t, backward_v, backward_a, rng):
    """An idle motor whose supply has a backward part: at that one it is as good as locked, six times the rated current at rated voltage."""
    turn = np.exp(100j * np.pi * t)
    volts = on_axes(326.6 * (turn + backward_v * np.conj(turn)))
    amperes = on_axes(11.7 * (-0.5j * turn + backward_a * np.conj(turn)))
    columns = [tuple(x + s * rng.standard_normal(t.size) for x in y) for y, s in ((amperes, 0.03), (volts, 0.5))]
    return RunningRecording(t, columns[0], columns[1], False, None, 2e-4, {}, "idle.csv")


def test_an_idle_motor_on_an_unbalanced_supply_has_no_crossed_channels():
    """Its current turns backwards from a voltage on whose backward part is a tenth of the forward one: it was told to exchange channels."""
    t, rng = 2e-4 * np.arange(5000), np.random.default_rng(3)
    (window,) = prepare([idle(t, 0.1, 0.6, rng)], PLATE).windows
    assert window.count > 4900
    with pytest.raises(DataRefused, match="turn against each other"):
        prepare([idle(t, 0.005, 0.7, rng)], PLATE)


def with_phase_u_open(recording, since):
    t, (u, v, w) = recording.time_s, recording.currents_a
    half, is_open = 0.5 * (v - w), t >= since
    sensed = 0.03 * np.random.default_rng(5).standard_normal(t.size)
    alone = (np.where(is_open, sensed, u), np.where(is_open, half, v), np.where(is_open, -half, w))
    return replace(recording, currents_a=alone)


def test_a_phase_that_opens_ends_what_is_used_and_is_named(start):
    recording, plate = start
    since = recording.time_s[0] + 1.2
    record = prepare([with_phase_u_open(recording, since)], plate)
    assert any("phase u carries no current from 1.2 s on" in r for r in record.remarks)
    assert len(record.windows) == 1 and record.windows[0].time_s[-1] < 1.2


def test_a_phase_that_is_open_throughout_is_what_a_refusal_names(start):
    recording, plate = start
    with pytest.raises(DataRefused, match="phase u carries no current"):
        prepare([with_phase_u_open(recording, -np.inf)], plate)


def test_a_test_at_standstill_without_its_columns_is_told_which_they_are():
    """Phase voltages of one axis: nothing turns."""
    t = np.arange(10_000) * 2e-4
    noise = 0.005 * np.random.default_rng(3).standard_normal((6, t.size))
    axis = np.array([[1.0], [-0.5], [-0.5]])
    volts, amps = 60.0 * axis * np.sin(126.0 * t) + noise[:3], 4.0 * axis * np.sin(126.0 * t - 0.6) + noise[3:]
    one = RunningRecording(t, tuple(amps), tuple(volts), False, None, 2e-4, source="axis.csv")
    with pytest.raises(DataRefused) as refusal:
        prepare([one], PLATE)
    assert "segment, axis_deg and voltage_axis_v" in refusal.value.remedy


def test_no_phase_of_a_sound_recording_is_called_open(start):
    assert not any("carries no current" in r for r in prepare([start[0]], start[1]).remarks)


def test_both_turning_backwards_is_said_and_used(start):
    recording, plate = start
    (a, b, c), (u, v, w) = recording.currents_a, recording.voltages_v
    record = prepare([replace(recording, currents_a=(a, c, b), voltages_v=(u, w, v))], plate)
    assert any("turns backwards" in r for r in record.remarks)
    straight = prepare([recording], plate).windows[0]
    assert np.allclose(record.windows[0].current, straight.current)


def test_pulses_and_slow_sampling_are_refused(start):
    recording, plate = start
    rng = np.random.default_rng(2)
    noisy = tuple(v + 200.0 * rng.choice([-1.0, 1.0], v.size) for v in recording.voltages_v)
    with pytest.raises(DataRefused, match="pulses"):
        prepare([replace(recording, voltages_v=noisy)], plate)
    with pytest.raises(DataRefused, match="too few"):
        prepare([replace(recording, sample_period_s=1e-3)], plate)


def test_a_lost_third_current_or_line_voltages_change_nothing(start):
    recording, plate = start
    u, v, w = recording.voltages_v
    record = prepare([recording], plate)
    lines = prepare([replace(recording, voltages_v=(u - v, v - w, w - u), voltages_are_line_to_line=True)], plate)
    assert np.allclose(lines.windows[0].voltage, record.windows[0].voltage, atol=1e-6 * plate.rated_voltage_v)
    two = prepare([replace(recording, currents_a=(*recording.currents_a[:2], np.full(u.size, np.nan)))], plate)
    assert not two.has_zero
    assert np.abs(two.windows[0].current[:, 2]).max() < 1e-12


def slow(supply_hz, per_period, seconds):
    """Balanced currents and voltages of a steady load, and a plate of this supply."""
    step = 1.0 / (supply_hz * per_period)
    t = np.arange(round(seconds / step)) * step
    phases = [2 * np.pi * supply_hz * t - k * 2 * np.pi / 3 for k in range(3)]
    plate = Nameplate(
        rated_power_w=2200.0, rated_voltage_v=400.0, rated_frequency_hz=supply_hz, rated_current_a=4.9,
        rated_speed_rpm=0.955 * 60.0 * supply_hz / 2, pole_pairs=2, power_factor=0.8,
        connection="star",
    )  # fmt: skip
    return RunningRecording(
        source="a.csv", time_s=t, currents_a=tuple(6.0 * np.cos(p - 0.6) for p in phases),
        voltages_v=tuple(326.0 * np.cos(p) for p in phases), voltages_are_line_to_line=False,
        speed_rad_per_s=None, sample_period_s=step,
    ), plate  # fmt: skip


@pytest.mark.parametrize(
    ("supply_hz", "per_period", "seconds", "fast", "is_for_monitor"),
    [(50.0, 20, 3.0, "5 kHz", True), (50.0, 20, 1.0, "5 kHz", False), (50.0, 8, 3.0, "5 kHz", False),
     (400.0, 20, 3.0, "16 kHz", True)],
)  # fmt: skip
def test_too_slow_for_a_fit_is_sent_to_the_verb_that_reads_it(supply_hz, per_period, seconds, fast, is_for_monitor):
    recording, plate = slow(supply_hz, per_period, seconds)
    with pytest.raises(DataRefused, match="too few") as refused:
        prepare([recording], plate)
    assert refused.value.remedy.startswith(f"record faster: {fast} or more")
    assert ("commissioner monitor" in refused.value.remedy) == is_for_monitor


def test_what_monitor_reads_is_what_it_reads():
    assert (MONITORED_S, MONITORED_RATE) == (clock.SHORTEST_S, clock.SLOWEST_RATE)


@pytest.mark.parametrize("lost", [1.0, 0.02])
def test_a_window_ends_before_the_contactor_opens_whatever_voltage_the_field_keeps(lost):
    """`lost`: share of a wrong current scale. What is left of the field had been the model's input, with no current for it to make."""
    made = started(PLATE)
    after = np.maximum(made.time_s - 1.6, 0.0)
    is_open = after > 0.0
    fades = np.where(is_open, 0.9 * np.exp(-after / 0.15), 1.0)
    noise = 0.035 * np.random.default_rng(5).standard_normal(made.time_s.size)
    currents = tuple(lost * np.where(is_open, noise, i) for i in made.currents_a)
    recording = replace(made, currents_a=currents, voltages_v=tuple(fades * v for v in made.voltages_v))
    (window,) = prepare([recording], PLATE).windows
    begins = made.time_s[101]
    assert begins + window.count * recording.sample_period_s == pytest.approx(1.6 - OPENING_S, abs=3 * 2e-4)


def test_a_gap_of_the_encoder_ends_a_stretch(start):
    """Without a speed there the machine has no input; the rest is used, and a column without any number is none."""
    recording, plate = start
    speed = recording.speed_rad_per_s.copy()
    gap = slice(speed.size // 2, speed.size // 2 + 300)
    speed[gap] = np.nan
    record = prepare([replace(recording, speed_rad_per_s=speed)], plate)
    before, behind = record.windows
    assert before.is_from_rest and not behind.is_from_rest
    assert before.count + behind.count == prepare([recording], plate).windows[0].count - 300
    assert all(np.isfinite(w.speed).all() for w in record.windows) and np.isfinite(record.sigma_w)
    assert "300 samples have no speed" in record.remarks[-1]
    assert not prepare([replace(recording, speed_rad_per_s=np.full(speed.size, np.nan))], plate).has_speed


def test_the_mains_unbalance_is_read_off_while_their_frequency_drifts_and_their_harmonics_stand():
    t = 2e-4 * np.arange(8000)
    angle = 314.16 * t + 0.4 * np.sin(2.0 * t)
    z = 326.6 * (np.exp(1j * angle) + 0.02 * np.exp(-1j * (angle + 1.0)) + 0.04 * np.exp(-1j * (5.0 * angle + 2.0)))
    assert negative_sequence(np.stack([z.real, z.imag], axis=1)) == pytest.approx(0.02 * 326.6, rel=0.05)


@pytest.mark.parametrize(("swing", "is_one"), [(0.0, True), (0.02, True), (0.3, False)])
def test_flicker_is_no_second_load(start, swing, is_one):
    """Voltage and current that swing together by 2 %, once a 0.1 s: no block of them is steady, and the load is one all the same."""
    recording, plate = start
    late = recording.time_s > 0.6
    t = recording.time_s[late]
    swung = 1.0 + 0.02 * np.sin(2.0 * np.pi * 10.0 * t)
    loaded = 1.0 + swing * (t > t[t.size // 2])
    one = replace(
        recording, time_s=t, voltages_v=tuple(swung * np.cos(314.0 * t + a) * 326.0 for a in (0.0, -2.0 * np.pi / 3.0, 2.0 * np.pi / 3.0)),
        currents_a=tuple(swung * loaded * np.cos(314.0 * t + a - 0.6) * 6.0 for a in (0.0, -2.0 * np.pi / 3.0, 2.0 * np.pi / 3.0)), speed_rad_per_s=None,
    )  # fmt: skip
    assert prepare([one], plate).has_one_load is is_one
    assert not prepare([recording], plate).has_one_load


def closed(slip, has_speed):
    """The plate's circuit, off to 0.1 s, then at each moment in its steady state at this slip."""
    t = np.arange(10_000) * 2e-4
    z = np.array([stator_impedance(from_nameplate(PLATE), 100 * np.pi, s) for s in slip(t)])
    v = 326.6 * np.exp(100j * np.pi * t + 0.4j) * (t > 0.1)
    i, u = (tuple((x * np.exp(-2j * np.pi * k / 3)).real for k in range(3)) for x in (v / z, v))
    return RunningRecording(t, i, u, False, 50 * np.pi * (1.0 - slip(t)) if has_speed else None, 2e-4, {}, "closed.csv")


@pytest.mark.parametrize("has_speed", [True, False])
def test_a_motor_that_does_not_start_is_said_to_stand(has_speed):
    """All of it was `start`, and nobody said that the shaft stands."""
    record = prepare([closed(np.ones_like, has_speed)], PLATE)
    (said,) = record.not_started
    assert said.startswith("closed.csv: the motor does not start: for 1.9 s") and "no more than 2%" in said
    assert any(r.startswith(said) and "look at shaft" in r for r in record.remarks)
    refusal = record.refusal_of_standing("identify")
    assert isinstance(refusal, DataRefused) and refusal.what == said and "shaft" in refusal.remedy


@pytest.mark.parametrize("has_speed", [True, False])
def test_a_motor_that_starts_is_not_said_to_stand(has_speed):
    record = prepare(
        [
            closed(lambda t: np.interp(t, [0.1, 2.0], [1.0, 0.4]), has_speed),
            closed(lambda t: np.interp(t, [0.3, 0.6], [1.0, 0.03]), has_speed),
        ],
        PLATE,
    )
    assert record.not_started == () and record.refusal_of_standing("identify") is None


@pytest.mark.parametrize(("supply_hz", "is_read"), [(50.02, True), (49.98, True), (50.4, True), (52.0, False)])
def test_2_khz_are_40_samples_a_period_of_the_mains_as_they_are(supply_hz, is_read):
    """2000 samples a second at 50 Hz were refused by `too few`, with 2000 as the limit: the mains stood at 50.000002 Hz."""
    recording, plate = slow(supply_hz, 2000.0 / supply_hz, 3.0)
    try:
        prepare([recording], plate)
    except DataRefused as refused:
        assert ("too few" in refused.what) is not is_read
    else:
        assert is_read


@pytest.mark.parametrize(("named", "is_carried"), [(4000.0, True), (4000, True), (0.0, False), ("", False)])
def test_an_inverter_is_what_names_its_carrier(start, named, is_carried):
    recording, plate = start
    metadata = dict(recording.metadata) | {"switching_frequency_hz": named}
    assert prepare([replace(recording, metadata=metadata)], plate).is_commanded is is_carried


@pytest.mark.parametrize("named", ["4 kHz", "abc", -4000.0, float("nan"), float("inf")])
def test_a_carrier_that_is_no_frequency_is_refused(start, named):
    recording, plate = start
    metadata = dict(recording.metadata) | {"switching_frequency_hz": named}
    with pytest.raises(DataRefused, match="switching_frequency_hz is no frequency") as refused:
        prepare([replace(recording, metadata=metadata)], plate)
    assert "in Hz" in refused.value.remedy


def test_a_speed_that_is_one_number_while_the_motor_starts_is_not_used(start):
    recording, plate = start
    told = prepare([replace(recording, speed_rad_per_s=np.full(recording.time_s.size, 150.4))], plate)
    assert not told.has_speed and any("one number all along" in said for said in told.remarks)
    steady = slice(recording.time_s.size // 2, None)
    cut = replace(
        recording, time_s=recording.time_s[steady], speed_rad_per_s=np.full(recording.time_s[steady].size, 150.4),
        currents_a=tuple(x[steady] for x in recording.currents_a), voltages_v=tuple(x[steady] for x in recording.voltages_v),
    )  # fmt: skip
    assert prepare([cut], plate).has_speed
