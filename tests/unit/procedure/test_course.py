"""The whole course against a scripted drive: what it asks, in which order, and how it ends. No socket, no file."""

from dataclasses import replace

import pytest

from commissioner.errors import Aborted, CheckFailed
from commissioner.motor.nameplate import Nameplate
from commissioner.procedure.checks import DriveLimits
from commissioner.procedure.course import Findings, Job, course
from commissioner.procedure.energised.closing_bias import SECONDS
from commissioner.procedure.findings import (
    AxisFinished,
    BiasChosen,
    EstimateUpdated,
    ExcitationChosen,
    StaircaseFitted,
    StateEntered,
    VerdictReached,
)
from commissioner.safety import commands as ask
from commissioner.settings import load_motor, load_procedure
from tests.support.scripted_drive import BLOCK, INTERLOCKS, PERIOD_S, Machine, ScriptedDrive

NAMES = {
    "stator_resistance": "stator_resistance_ohm", "rotor_resistance": "rotor_resistance_ohm",
    "leakage_inductance": "leakage_inductance_h", "magnetizing_inductance": "magnetizing_inductance_h",
}  # fmt: skip


def _job(axes=(0.0,), write_back=True, **limits) -> Job:
    """Two seconds of tones along each axis."""
    plan = load_procedure(axes_deg=axes)
    plan = replace(
        plan,
        excitation=replace(plan.excitation, seconds=2.0),
        supervision=replace(plan.supervision, standstill_dwell_s=0.06),
        limits=replace(plan.limits, **limits),
    )
    return Job(plan, load_motor("motor_2kw2"), DriveLimits(480.0, 640.0, 85.0, 120.0), NAMES, write_back, 0.005)


@pytest.fixture(scope="module")
def good_run():
    """One run over two axes and a repeat, shared by the tests that only look at it."""
    drive, findings, job = ScriptedDrive(), Findings(), _job((0.0, 60.0))
    return drive.run(course(job, findings)), drive, findings, job


def _told(drive, kind):
    return [record for record in drive.told if isinstance(record, kind)]


def test_a_good_machine_ends_as_commissioned_with_its_parameters(good_run):
    ended, drive, findings, _ = good_run
    assert ended.outcome == "commissioned"
    got, true = findings.identification.parameters, drive.machine
    for value, truth in zip(got.as_tuple(), (true.r_s, true.r_r, true.l_sigma, true.l_m), strict=True):
        assert value == pytest.approx(truth, rel=0.003)
    assert {w.name for w in findings.written} == set(NAMES.values())


def test_the_states_follow_the_table_and_each_test_names_its_axis(good_run):
    _, drive, _, _ = good_run
    entered = [(s.state.split()[0], s.axis_deg) for s in _told(drive, StateEntered)]
    tests = [
        ("measuring", 0.0),
        ("exciting", 0.0),
        ("measuring", 60.0),
        ("exciting", 60.0),
        ("measuring", 0.0),
        ("exciting", 0.0),
    ]
    assert entered == [("connecting", None), ("checking", None), *tests, ("judging", None), ("writing", None)]


def test_watchdog_and_drive_limits_stand_before_the_first_enable(good_run):
    _, drive, _, _ = good_run
    kinds = [type(c) for c in drive.sent]
    first = kinds.index(ask.Enable)
    for wanted in (ask.TakeSnapshot, ask.ArmWatchdog, ask.SetDriveLimits, ask.LoadExcitation):
        assert wanted in kinds[:first]


def test_every_enable_is_followed_by_a_disarm_and_writing_comes_after_the_last(good_run):
    _, drive, _, _ = good_run
    marks = [type(c) for c in drive.sent if isinstance(c, ask.Enable | ask.Disarm | ask.WriteParameters)]
    sessions = [m for m in marks if m is not ask.WriteParameters]
    assert sessions == [ask.Enable, ask.Disarm] * (len(sessions) // 2)
    assert marks[-1] is ask.WriteParameters


def test_amplitude_starts_small_and_the_true_flux_stays_below_the_limit(good_run):
    _, drive, _, job = good_run
    scales = [c.scale for c in drive.sent if isinstance(c, ask.SetScale)]
    assert scales[0] <= job.plan.excitation.first_scale
    assert drive.peak_flux_wb <= 1.02 * job.flux_limit_wb(drive.machine.r_s)


def test_each_axis_stays_within_twelve_seconds_of_energised_time(good_run):
    _, drive, _, job = good_run
    assert drive.energised_s / len(job.plan.tests_deg) <= 12.0  # with the first look, which is made once
    designed = [e for e in _told(drive, ExcitationChosen) if e.seconds > 2.0]
    assert all(len(e.tones) >= 4 for e in designed)


def test_each_test_ends_on_a_dc_bias_that_comes_after_the_tones_have_gone_down(good_run):
    _, drive, _, job = good_run
    biases = _told(drive, BiasChosen)
    assert [b.axis_deg for b in biases] == [0.0, 60.0, 0.0]
    for bias in biases:
        assert bias.seconds == SECONDS
        assert 0.5 < bias.peak_flux_fraction < 0.9
        lowered = next(k for k, c in enumerate(drive.sent) if isinstance(c, ask.SetScale) and c.scale == bias.scale)
        following = drive.sent[lowered:]
        at = next(k for k, c in enumerate(following) if isinstance(c, ask.SetBias) and c.bias_v == bias.bias_v)
        fetched = sum(isinstance(c, ask.Fetch) for c in following[:at])
        assert fetched * BLOCK * PERIOD_S >= 1.0 / job.scale_ramp_per_s - PERIOD_S


def test_estimates_are_told_ten_times_a_second_and_settle(good_run):
    _, drive, _, job = good_run
    estimates = _told(drive, EstimateUpdated)
    axis = [e for e in estimates if e.axis_deg == 60.0]
    assert len(axis) >= 8 * job.plan.excitation.seconds
    assert axis[-1].parameters[0] == pytest.approx(drive.machine.r_s, rel=0.01)
    assert [f.has_settled for f in _told(drive, AxisFinished)][1:] == [True, True, True]


def test_nothing_is_written_unless_it_was_asked_for():
    drive, findings = ScriptedDrive(), Findings()
    ended = drive.run(course(_job(write_back=False), findings))
    assert ended.outcome == "commissioned"
    assert not any(isinstance(c, ask.WriteParameters) for c in drive.sent)
    assert findings.written == ()


def test_a_machine_that_is_not_the_plates_is_rejected_and_not_written():
    drive, findings = ScriptedDrive(Machine(r_s=3.7, r_r=2.1, l_sigma=0.0013, l_m=0.224)), Findings()
    ended = drive.run(course(_job(), findings))
    assert ended.outcome == "rejected"
    verdict = _told(drive, VerdictReached)[-1]
    assert verdict.decision == "reject"
    assert verdict.remedy
    assert not any(isinstance(c, ask.WriteParameters) for c in drive.sent)


@pytest.mark.parametrize(
    "status",
    [
        {"interlocks": INTERLOCKS | {"sto_released": False}},
        {"fault_code": 3, "fault_text": "earth fault"},
        {"dc_link_v": 300.0},
        {"heatsink_degc": 99.0},
        {"shaft_speed_rad_per_s": 20.0},
    ],
)
def test_a_failed_check_energises_nothing_and_says_why(status):
    drive = ScriptedDrive(status=status)
    with pytest.raises(CheckFailed) as caught:
        drive.run(course(_job(), Findings()))
    assert caught.value.exit_code == 3
    assert caught.value.remedy
    assert drive.energised_s == 0.0
    assert not any(isinstance(c, ask.Enable | ask.ArmWatchdog | ask.LoadExcitation) for c in drive.sent)


def test_a_drive_that_ends_the_test_by_itself_aborts_the_run():
    drive = ScriptedDrive()

    def cut(command, at):
        if isinstance(command, ask.LoadExcitation):
            object.__setattr__(command, "duration_s", 0.5)

    drive.before = cut
    with pytest.raises(Aborted, match="ended the test by itself"):
        drive.run(course(_job(), Findings()))


def test_an_open_motor_cable_is_named():
    drive = ScriptedDrive(Machine(r_s=1e5, r_r=2.1, l_sigma=0.021, l_m=0.224))
    with pytest.raises(Aborted, match="no current flows") as caught:
        drive.run(course(_job(), Findings()))
    assert "cable" in caught.value.remedy


def test_short_gaps_in_the_stream_are_counted_and_do_not_spoil_the_answer():
    drive, findings = ScriptedDrive(lose=lambda index: 7 if index % 4000 < 29 else 0), Findings()
    ended = drive.run(course(_job(), findings))
    assert ended.outcome == "commissioned"
    assert findings.identification.lost_samples > 0
    assert findings.identification.parameters.stator_resistance_ohm == pytest.approx(drive.machine.r_s, rel=0.01)


def test_later_axes_begin_at_the_amplitude_that_the_first_has_earned(good_run):
    _, drive, _, _ = good_run
    begun, scales = [], []
    for command in drive.sent:
        if isinstance(command, ask.Enable):
            scales = []
            begun.append(scales)
        if isinstance(command, ask.SetScale):
            scales.append(command.scale)
    first = [s[0] for s in begun if s]
    assert len(first) == 4  # the look, and three tests
    assert all(scale > 0.5 for scale in first[1:])


def test_the_winding_temperature_of_the_check_refers_the_resistance_to_20_degrees():
    drive, findings = ScriptedDrive(status={"winding_degc": 75.0}), Findings()
    drive.run(course(_job(), findings))
    at_20, _ = findings.identification.stator_resistance_20degc_ohm
    # IEC 60034-1: R2/R1 = (235 + t2) / (235 + t1), copper
    assert at_20 == pytest.approx(drive.machine.r_s * (235 + 20) / (235 + 75), rel=0.004)


def test_what_a_longer_test_would_buy_is_known_after_a_run(good_run):
    _, _, findings, job = good_run
    longer = findings.longer_test
    assert longer.seconds == 2 * job.plan.excitation.seconds
    for now, then in zip(longer.now, longer.then, strict=True):
        assert 0.7 * now < then <= now


def test_a_longer_test_is_measured_by_the_tones_that_were_played():
    drive, findings, job = ScriptedDrive(), Findings(), _job(axis_time_s=5.0)
    job = replace(job, plan=replace(job.plan, excitation=replace(job.plan.excitation, seconds=10.0)))
    drive.run(course(job, findings))
    test = _told(drive, AxisFinished)[-1]
    assert test.energised_s < _told(drive, ExcitationChosen)[-1].seconds
    assert findings.longer_test.seconds == pytest.approx(2 * test.energised_s)


def test_the_staircase_of_a_slow_machine_is_not_waited_out():
    machine = Machine(r_s=0.625, r_r=0.376, l_sigma=0.0107, l_m=0.19)
    drive, findings = ScriptedDrive(machine, rated_a=20.0), Findings()
    plate = Nameplate(7500.0, 400.0, 50.0, 14.2, 1454.0, 0.858, 2, "star")
    job = replace(_job(), nameplate=plate)
    ended = drive.run(course(job, findings))
    assert ended.outcome == "commissioned", ended.reason
    fitted = _told(drive, StaircaseFitted)
    # 0.8 s time constant: six settled levels would take 24 s
    assert fitted[0].energised_s < 6.0
    assert fitted[0].stator_resistance_ohm == pytest.approx(machine.r_s, rel=0.1)
    assert drive.peak_flux_wb <= 1.02 * job.flux_limit_wb(machine.r_s)


class Sagging(ScriptedDrive):
    """Does not correct its voltage for its link, which falls to 486 of 540 V as it is energised for the third time: after first current
    and staircase."""

    link = 1.0

    def _start(self):
        super()._start()
        self.link = 0.9 if self._session >= 3 else 1.0
        self._bd = self.link * self.machine.matrices()[1]

    def _fetch(self):
        block = super()._fetch()
        return None if block is None else replace(block, dc_link_v=540.0 * self.link)


def test_a_link_that_fell_before_the_tests_is_said_and_nothing_is_written():
    """All four values come out as 1/0.9 of the true ones, on every axis alike: the link alone tells."""
    drive, findings = Sagging(), Findings()
    ended = drive.run(course(_job((0.0, 60.0)), findings))
    found, true = findings.identification.parameters, drive.machine
    assert found.stator_resistance_ohm == pytest.approx(true.r_s / 0.9, rel=0.02)
    assert found.leakage_inductance_h == pytest.approx(true.l_sigma / 0.9, rel=0.02)
    assert ended.outcome == "rejected"
    assert ended.reason == "the DC link moved between the tests"
    assert not any(isinstance(c, ask.WriteParameters) for c in drive.sent)
    assert any("486 and 540 V" in remark for remark in findings.identification.remarks)
