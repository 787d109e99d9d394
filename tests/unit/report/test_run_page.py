"""The run's report for every way a run can end: what stands on the first page, and what must never stand there."""

import json
import re

import numpy as np
import pytest

from commissioner.history.motor import Measured, motor_trends
from commissioner.identify.estimate.axes import Combined
from commissioner.identify.estimate.common_ground import Result
from commissioner.motor.circuit import InverseGamma
from commissioner.procedure.steps import Findings
from commissioner.records import SampleBlock
from commissioner.report.run.evidence import iron
from commissioner.report.run.page import run_page
from commissioner.report.run.subject import Subject
from commissioner.report.sheet.words import check_words

PLAN = {
    "axes_deg": [0.0, 60.0], "repeat_first": True, "supervision": {"watchdog_s": 0.5},
    "limits": {"current_fraction": 1.0, "trip_fraction": 1.4, "flux_fraction": 0.9}, "excitation": {"seconds": 4.6},
    "acceptance": {
        "resistance_std_percent": 1.0, "leakage_std_percent": 2.0, "rotor_resistance_std_percent": 3.0,
        "magnetizing_std_percent": 3.0, "axis_spread_percent": 6.0,
    },
}  # fmt: skip
PLATE = {
    "rated_power_w": 2200.0, "rated_voltage_v": 400.0, "rated_frequency_hz": 50.0, "rated_current_a": 5.0, "rated_speed_rpm": 1436.0,
    "power_factor": 0.8, "pole_pairs": 2, "connection": "star",
}  # fmt: skip
DRIVE = {
    "drive_type": "SIM-INV-7A", "serial_number": 7, "firmware_version": "1.2.3", "map_version": 1, "rated_drive_current_a": 7.0,
    "control_period_s": 2e-4, "switching_frequency_hz": 5000.0,
}  # fmt: skip
VALUES = {
    "stator_resistance_ohm": (3.716, 0.005, 3.2), "rotor_resistance_ohm": (2.1847, 0.0016, 1.8),
    "leakage_inductance_h": (0.021486, 0.000013, 0.026), "magnetizing_inductance_h": (0.30908, 0.00026, 0.2),
}  # fmt: skip


def line(kind, record, utc="2026-11-25T10:00:00.000000+00:00"):
    return {"kind": kind, "utc": utc, "record": record}


JOURNAL = [
    line("run_started", {"person": "operator 1", "host": "panel", "local_time": "2026-11-25 11:00:00+01:00"}),
    line("job", {"plan": PLAN, "nameplate": PLATE}),
    line("parameters_written", {"written": [], "is_stored": True}),
    line("run_ended", {"outcome": "x", "reason": "y"}, "2026-11-25T10:01:05.000000+00:00"),
]


def result(outcome="commissioned", *, written=True, **more):
    names = list(VALUES)
    document = {
        "run": "20261125-100000-x-abcdef", "outcome": outcome, "reason": "every parameter is within its acceptance", "error": None,
        "energised_s": 46.9, "drive": DRIVE, "before": {name: old for name, (_, _, old) in VALUES.items()},
        "checks": [{"name": "no fault", "has_passed": True, "value": "none", "limit": "none", "remedy": ""}],
        "written": [
            {"name": n, "field": n, "register": 576 + 2 * k, "before": VALUES[n][2], "after": VALUES[n][0], "read_back": VALUES[n][0]}
            for k, n in enumerate(names)
        ] if written else [],
        "objections": [], "parameters": {n: {"value": v, "std": s} for n, (v, s, _) in VALUES.items()}, "remarks": [],
        "diagnosis": None, "flux_guard": {"peak_fraction": 0.915, "limit_wb": 0.877, "acted": False},
        "holds_for_stator_flux_wb": 0.716, "rated_flux_wb": {"stator_rms": 0.689, "stator_peak": 0.974},
        "magnetizing_curve": [
            {"stator_flux_wb": 0.04, "magnetizing_inductance_h": {"value": 0.318, "std": 0.0004}},
            {"stator_flux_wb": 0.802, "magnetizing_inductance_h": {"value": 0.29877, "std": 0.0003}},
        ],
        "dispersion": {"stator_resistance_ohm": 0.0031}, "gaps": {"count": 0, "lost_samples": 0},
        "t_model": {"assumption": "equal leakage (L_s = L_r)"} | {
            n: {"value": 1.0, "std": 0.0}
            for n in ("stator_resistance_ohm", "rotor_resistance_ohm", "stator_leakage_h", "rotor_leakage_h", "magnetizing_inductance_h")
        },
    }  # fmt: skip
    return document | more


def first_page(document, journal=JOURNAL, request=None):
    page = run_page(document, journal, Findings(), request, "ab" * 32)
    return re.search(r'<section class="pg" id="result">.*?</section><section class="pg', page, re.S).group(0), page


def words(markup):
    return re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", markup))


def test_a_good_run_shows_value_interval_old_change_register_and_what_to_do_next():
    first, page = first_page(result())
    text = words(first)
    assert "Commissioned: four values accepted, written and read back" in text
    assert "3.7160 ± 0.0098 Ω" in text
    assert "± 0.26 %" in text
    assert "+16.1 %" in text
    assert "commissioner restore 20261125-100000-x-abcdef" in text
    assert "stator flux of 0.716 Wb peak, 74 % of rated" in text
    assert "1.77 A rms" in text  # 0.802 Wb / (298.77 + 21.486 mH) / sqrt 2
    assert 'content: "SHA-256 of result.json: abababababababababab' in page


def test_what_a_person_told_is_shown_and_what_nobody_told_is_a_line_to_write_on():
    said = {"origin": {"motor_tag": "P-17", "motor_serial": "0471", "place": "hall 3"}}
    first, page = first_page(result(), request=said)
    assert "P-17" in words(first)
    assert "operator 1, hall 3" in words(first)
    assert "Commissioning report, motor P-17" in page
    assert first_page(result())[0].count('class="fill"') == 3
    later = [*JOURNAL, line("motor_named", {"motor_tag": "P-18"})]
    assert "P-18" in words(first_page(result(), later, said)[0])


def test_a_simulated_run_says_so_on_every_printed_page_and_a_real_one_does_not():
    assert '@top-center { content: "Simulated drive and motor" }' in first_page(result())[1]
    real = result(drive=DRIVE | {"drive_type": "ACME-1"})
    assert "Simulated drive" not in first_page(real)[1]


def test_an_accepted_run_that_wrote_nothing_does_not_say_written():
    text = words(first_page(result(written=False))[0])
    assert "Accepted, not written: the drive holds its old values" in text
    assert "commissioner write-back" in text
    assert "not written" in text


def test_a_rejected_run_says_what_to_do_before_anything_else_and_no_value_looks_usable():
    objection = {
        "what": "rotor_resistance_ohm is too uncertain", "value": "4.0 % standard error", "limit": "3 %", "remedy": "lengthen the test",
    }  # fmt: skip
    first, _ = first_page(
        result("rejected", written=False, objections=[objection], reason="rotor_resistance_ohm is too uncertain")
    )
    text = words(first)
    assert "Not good enough: nothing written" in text
    assert text.index("Do this") < text.index("Why") < text.index("Motor")
    assert "Lengthen the test." in text
    assert "not to be used" in text
    assert 'class="val"' not in first


@pytest.mark.parametrize(
    ("outcome", "title"),
    [("aborted", "Aborted: nothing written"), ("faulted", "Broken off by a fault: nothing written")],
)
def test_a_run_that_ended_early_names_step_value_limit_and_remedy(outcome, title):
    error = {
        "what": "the flux reached its limit",
        "step": "flux guard, axis 120 deg",
        "value": 0.884,
        "limit": 0.877,
        "unit": "Wb",
        "remedy": "compare the connection with the plate",
    }
    bare = result(outcome, written=False, error=error, parameters={}, reason="the flux reached its limit")
    for name in ("magnetizing_curve", "t_model", "rated_flux_wb", "holds_for_stator_flux_wb", "dispersion", "gaps"):
        del bare[name]
    text = words(first_page(bare)[0])
    assert title in text
    for told in ("flux guard, axis 120°", "0.884 Wb", "0.877 Wb", "Compare the connection with the plate."):
        assert told in text


def test_a_value_beyond_its_limit_is_never_shown_as_the_limit():
    error = {"what": "the axis was energised too long", "step": "watch", "value": 16.02, "limit": 16.0, "unit": "s"}
    text = words(first_page(result("aborted", written=False, error=error | {"remedy": ""}, parameters={}))[0])
    assert "16.02 s" in text
    assert "16.00 s" in text


def test_a_check_has_no_key_and_a_unit_on_both_sides():
    checks = [
        ("rated_power_w in the drive", 2200.0, "2200 within 5%", "rated power in the drive 2200 W 2200 W within 5 %"),
        ("heatsink temperature, degC", 32.0, "at most 85 °C", "heatsink temperature 32.0 °C at most 85 °C"),
        ("drive rated for the test current", 9.899, "at least 6.36 A peak", "9.90 A at least 6.36 A peak"),
        ("pole_pairs in the drive", 2, "2 within 5%", "pole pairs in the drive 2 2 within 5 %"),
    ]
    rows = [{"name": n, "has_passed": True, "value": v, "limit": w, "remedy": ""} for n, v, w, _ in checks]
    text = words(run_page(result(checks=rows), JOURNAL, Findings())).replace("\u00a0", " ")
    for *_, told in checks:
        assert told in text
    assert "32.0 °C" in words(first_page(result(checks=rows))[0])


def test_the_record_has_the_digest_of_the_result_as_it_is_and_not_as_it_was_before_the_diagnosis():
    files = {"result.json": {"bytes": 2, "sha256": "01" * 32}, "request.json": {"bytes": 2, "sha256": "cd" * 32}}
    text = words(run_page(result(), [*JOURNAL, line("folder_closed", {"files": files})], Findings(), {}, "ab" * 32))
    assert f"result.json {'ab' * 32}" in text and f"request.json {'cd' * 32}" in text
    assert "01" * 32 not in text


@pytest.mark.parametrize(("passed", "told"), [(False, "479.8 V"), (True, "480 V")])
def test_a_value_that_failed_is_never_rounded_into_its_limits(passed, told):
    check = {
        "name": "DC link in range",
        "has_passed": passed,
        "value": 479.8,
        "limit": "480 ... 640 V",
        "remedy": "wait",
    }
    assert check_words(check) == ("DC link in range", told, "480 ... 640 V")


def test_what_the_estimator_says_is_set_with_symbols_and_no_parameters_key_reaches_the_page():
    journal = [*JOURNAL, line("run_ended", {"outcome": "rejected", "reason": "rotor_resistance_ohm is too uncertain"})]
    remark = "the currents lie +12.0 +- 0.7 us behind; L_M holds at 75% of L_sigma"
    rejected = result("rejected", written=False, remarks=[remark], reason="rotor_resistance_ohm is too uncertain")
    page = run_page(rejected, journal, Findings())
    assert "The currents lie +12.0 ± 0.7\u00a0µs behind; L<sub>M</sub> holds at 75\u00a0% of L<sub>σ</sub>." in page
    assert "R<sub>R</sub> is too uncertain. The drive is as it was found." in page
    assert "resistance_ohm" not in page


def test_the_procedures_numbers_have_their_units():
    plan = PLAN | {"acceptance": PLAN["acceptance"] | {"strict": False}}
    journal = [JOURNAL[0], line("job", {"plan": plan, "nameplate": PLATE}), *JOURNAL[2:]]
    text = words(run_page(result(), journal, Findings()))
    for told in (
        "watchdog_s 0.5 s",
        "seconds 4.6 s",
        "flux_fraction 0.9 of rated",
        "axis_spread_percent 6 %",
        "strict no",
    ):
        assert told in text, told
    assert "leakage_std_percent 2 % (± 3.9 % here)" in text


def test_a_finding_has_the_95_percent_interval_that_every_page_promises_and_its_digits():
    found = {"cause": "sensor_gain", "sentence": "sensors differ", "relative_size": 0.14231, "relative_std": 0.00017}
    page = run_page(result(findings=[found]), JOURNAL, Findings())
    assert "Sensors differ, by 14.231 ± 0.033\u00a0%." in page  # 1.96 x 0.017 %


def test_one_value_is_one_value_and_a_guard_that_acted_is_not_hidden():
    document = result(flux_guard={"peak_fraction": 1.0, "limit_wb": 0.877, "acted": True})
    document["written"] = document["written"][:1]
    text = words(first_page(document)[0])
    assert "Commissioned: one value accepted, written and read back" in text
    assert "no limit was reached" not in text
    assert "the flux guard took the amplitude back" in text


def test_a_long_tag_never_runs_over_its_neighbours_in_the_margin():
    tag = "Kühlwasserpumpe Halle 12 Süd, Reserveaggregat mit langer Bezeichnung"
    first, page = first_page(result(), request={"origin": {"motor_tag": tag}})
    margin = re.search(r'@top-left { content: "([^"]*)" }', page).group(1)
    assert len(margin) <= 54
    assert margin.endswith("…")
    assert tag in words(first)


def test_a_change_a_year_has_the_places_of_its_interval():
    page = run_page(result(), JOURNAL, Findings(), years=history(40))
    changes = re.findall(r'data-l="Change a year">([^<>]*) ± ([^<>]*) %<', page)
    assert len(changes) == 4
    for value, half in changes:
        assert len(value.partition(".")[2]) == len(half.partition(".")[2]), (value, half)


TUNED = {
    "name": "motor_r1", "unit": "mohm", "before": 3200.0, "values": [3716.0, 3720.0], "median": 3718.0, "spread_percent": 0.11,
    "trend_percent": 0.1, "change_percent": 16.2, "field": "stator_resistance_ohm", "ours": 3.718, "conversion": "per phase",
    "plate_low": 0.5, "plate_high": 12.0, "earlier": [],
}  # fmt: skip


def test_a_tuned_result_has_its_unit_in_every_column():
    tune = {"in_the_drive": "the best repeat", "repeats": [{}], "form": "standstill", "rows": [TUNED]}
    error = {
        "what": "stopped",
        "step": "tune",
        "value": 15.200000762939453,
        "limit": 14.0,
        "unit": "A",
        "remedy": "look",
    }
    text = words(run_page(result("faulted", written=False, tune=tune, error=error), JOURNAL, Findings()))
    for told in ("3200 mohm", "3716, 3720 mohm", "3.718 Ω (per phase)", "0.5 ... 12 Ω", "15.2 A", "one time"):
        assert told in text, told


def test_a_run_that_ended_in_the_direct_currents_was_energised_and_says_so():
    lost = result("faulted", written=False, parameters={}, reason="the drive sends no samples")
    block = SampleBlock(1, 0, 2e-4, 0.0, np.ones(5), np.ones(5), -np.ones(5), None, 540.0)
    assert "direct current; no test begun" in words(run_page(lost, JOURNAL, Findings(blocks=[(0, block)])))
    assert "no tests begun" in words(run_page(lost, JOURNAL, Findings()))


def test_a_run_that_broke_off_draws_current_and_flux_up_to_its_end():
    """Two tests of 0.3 s each, judged every tenth: one row of 0.6 s."""
    samples = np.full(1000, 3.0)
    block = SampleBlock(1, 0, 2e-4, 0.0, samples, samples, -0.5 * samples, None, 540.0)
    course = (0.1, 0.2, 0.3, 0.1, 0.2, 0.3)
    judged = [
        line("estimate_updated", {"time_s": s, "flux_fraction": f})
        for s, f in zip(course, np.linspace(0.5, 1.02, 6), strict=True)
    ]
    stopped = result("aborted", written=False, parameters=None, magnetizing_curve=None)
    blocks = [(0, block), (1, block)]
    subject = Subject(stopped, [*JOURNAL, *judged], Findings(blocks=blocks), {})
    assert subject.guarded[0] == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    assert subject.applied_a[0][-1] == pytest.approx(0.4) and subject.applied_a[1] == pytest.approx(3.0)
    page = run_page(stopped, [*JOURNAL, *judged], Findings(blocks=blocks))
    assert 'class="pg flows" id="evidence"' in page and 'class="pg flows" id="a"' in page  # one figure fills no sheet
    said = words(page)
    assert "Up to the end of the run" in said and "limit 9.90 A" in said and "limit 0.877 Wb" in said
    assert "Stator flux by the guard" not in words(run_page(stopped, JOURNAL, Findings(blocks=blocks)))
    assert "The evidence" not in words(run_page(stopped, JOURNAL, Findings()))


def test_a_run_that_broke_off_counts_what_it_did_and_speaks_of_no_result():
    """A test that came to its end stood among the missing, lost samples were "not known", and a chapter explained no interval."""
    current = np.zeros(5)
    block = SampleBlock(1, 10, 2e-4, 0.0, current, current, current, None, 540.0, lost_before=3)
    finished = [line("axis_finished", {"axis_deg": 0.0, "is_look": is_look}) for is_look in (True, False)]
    broken = result("faulted", written=False, parameters=None, gaps=None, magnetizing_curve=None)
    text = run_page(broken, [*JOURNAL, *finished], Findings(blocks=[(0, block)]), None)
    said = words(text)
    assert "two tests of 3: the run ended before" in said
    assert "Samples lost 3 of 5" in said
    assert "Uncertainty" not in said
    assert "B. Procedure, circuit" in said
    assert text.index("Conventions") < text.index("The circuit of this report")  # in the shorter column


def test_the_results_dot_lies_inside_its_panel_also_beyond_the_measured_curve():
    """The result, led on by the curve to 0.73 Wb, was drawn below the axis, over the caption."""
    value = {"magnetizing_inductance_h": {"value": 0.28, "std": 0.0003}}
    drawn = iron(Subject(result(parameters=value, holds_for_stator_flux_wb=0.95), JOURNAL, Findings(), {}))
    (height,) = {float(y) for y in re.findall(r'<circle[^>]* cy="([\d.]+)"', drawn)}
    (base,) = {float(y) for y in re.findall(r'class="ax" d="M28 ([\d.]+)H', drawn)}
    assert height < base - 12


def test_safe_torque_off_is_read_as_released_only_where_it_was_read():
    sto = {"name": "safe torque off is released", "has_passed": True, "value": True, "limit": True, "remedy": ""}
    assert "safe torque off: read as released, not tried" in words(first_page(result(checks=[sto]))[0])
    text = words(first_page(result("aborted", written=False, parameters={}, checks=[]))[0])
    assert "safe torque off: not tried" in text
    assert "three tests of 3: the run ended before" in text


def test_a_check_of_a_parameter_has_its_symbol():
    slow = {
        "name": "the link keeps up", "has_passed": True, "value": "L_M up to half as large again", "limit": "x", "remedy": ""
    }  # fmt: skip
    assert "L<sub>M</sub> up to half" in run_page(result(checks=[slow]), JOURNAL, Findings())


def test_every_head_of_a_table_says_what_it_heads():
    heads = re.findall(r"<th\b[^>]*>", run_page(result(), JOURNAL, Findings(), years=history(40)))
    assert heads
    assert all('scope="col"' in head or 'scope="row"' in head for head in heads)


def test_a_fault_after_writing_says_how_to_get_the_old_values_back():
    text = words(first_page(result("faulted", error={"what": "x", "remedy": "look"}))[0])
    assert "nothing written" not in text
    assert "commissioner restore" in text


def test_a_value_that_the_drive_holds_otherwise_is_marked():
    document = result()
    document["written"][0]["read_back"] = 3.7
    assert "not 3.716" in words(first_page(document)[0])


def test_a_diagnosis_is_told_with_its_sizes_and_one_that_was_stopped_is_not():
    diagnosis = {
        "verdict": "explained", "reason": "r", "moved": [], "remarks": [], "is_complete": True,
        "gain": {"rmse_before_a": 0.285, "rmse_after_a": 0.0125, "noise_floor_a": 0.0104, "held_out": 0.9994},
        "causes": [{
            "name": "dead_time", "title": "Dead time of the legs", "equivalent": ["device_drop"], "confidence": 0.99989, "strength_over_noise": 27.0,
            "parameters": {"voltage_v": {"value": 7.7626, "std": 0.0257, "unit": "V"}, "unequal_v": {"value": 0.0002, "std": 3e-5, "unit": "1"}},
        }],
        "parameters_before": {"stator_resistance_ohm": {"value": 9.5, "std": 1e-4}},
        "parameters_after": {"stator_resistance_ohm": {"value": 3.737, "std": 0.019}},
        "detection_limits": {"iron_loss": {"conductance_ms": {"value": 0.22, "unit": "mS"}}, "dc_link_ripple": {"fraction": {"value": 0.001, "unit": "1"}}, "dead_time": {"v": {"value": 1.0, "unit": "V"}}},
        "cannot_tell": ["a | b"],
        "next_experiment": {"steps": ["Halve it.", "Read both together:"], "command": "commissioner diagnose a b", "changes_values": "No."},
    }  # fmt: skip
    text = words(run_page(result(diagnosis=diagnosis), JOURNAL, Findings()))
    for told in (
        "7.763 ± 0.050 V",
        "unequal v 0.0200 ± 0.0059 %",
        "99.9 %",
        "+156 %",
        "0.22 mS",
        "DC link ripple",
        "commissioner diagnose a b",
        "285 mA",
    ):
        assert told in text, told
    assert "Dead time 1" not in text  # found, so no limit is told
    stopped = words(run_page(result(diagnosis=diagnosis | {"is_complete": False}), JOURNAL, Findings()))
    assert "was stopped" in stopped
    assert "7.763" not in stopped


def test_text_from_drive_plate_and_person_is_escaped():
    evil = "<img src=x onerror=alert(1)>"
    document = result(drive=DRIVE | {"drive_type": evil, "firmware_version": evil}, reason=evil)
    page = run_page(document, JOURNAL, Findings(), {"origin": {"motor_tag": evil, "place": evil, "cable": evil}})
    assert "<img" not in page
    assert json.dumps(evil)[1:-1] not in page


def history(points, degc=24.0):
    """A motor whose rotor resistance changed by 8 % in between."""
    measured = []
    for k in range(points):
        r_r = 2.18 * (1.08 if k >= points // 2 else 1.0)
        combined = Combined(
            InverseGamma(3.716, r_r, 0.02146, 0.3091), np.diag([1e-3, 1e-3, 1e-6, 1e-4]) ** 2, (0.0,) * 4, (), ()
        )
        measured.append(Measured(f"2019{k:02d}01", 3.15e7 * k, Result(f"2019{k:02d}01", combined, 0.716, (), degc)))
    return motor_trends(measured)


def test_a_motor_with_earlier_runs_has_them_drawn_with_what_moved():
    page = run_page(result(), JOURNAL, Findings(), years=history(8))
    text = words(page)
    assert "8 runs of this motor, at a stator flux of 0.716 Wb and 24.0 °C" in text
    assert re.search(r"Rotor resistance has moved by \+8\.0+ ± 0\.0*[1-9]\d % from", text)
    assert page.count('aria-label="rotor resistance over 8 runs, in Ω"') == 1
    assert "2.354 ±" in text


def test_two_runs_have_no_change_a_year_and_none_no_sheet():
    assert "too few runs" in words(run_page(result(), JOURNAL, Findings(), years=history(2)))
    assert "over the years" not in words(run_page(result(), JOURNAL, Findings()))


@pytest.mark.parametrize(("axes", "tests"), [([0.0], "one test of 1"), ([0.0, 60.0], "three tests of 3")])
def test_one_axis_alone_is_not_repeated(axes, tests):
    journal = [JOURNAL[0], line("job", {"plan": PLAN | {"axes_deg": axes}, "nameplate": PLATE}), *JOURNAL[2:]]
    text = words(run_page(result(), journal, Findings()))
    assert f"{tests}: the run ended before" in text
    assert ("the first again" in text) is (len(axes) > 1)
