"""What a technician reads in a diagnosis: numbers, causes that look alike, the error's tie to the command."""

import numpy as np
import pytest

from commissioner.diagnose.document import refused_document
from commissioner.diagnose.fit.normal_equations import Normal
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.intake.record import Facts, Record, Segment
from commissioner.diagnose.intake.refusal import refused
from commissioner.diagnose.plant.model import NO_DICTIONARY, Model, Term
from commissioner.diagnose.search.screening import Score, Screening
from commissioner.diagnose.verdict.collinearity import look_alikes
from commissioner.diagnose.verdict.residuals import residuals
from commissioner.report import page
from commissioner.report.diagnosis import figures
from commissioner.report.diagnosis.numbers import limit_words, number, part_word, percent, quantity, sure
from commissioner.report.diagnosis.sections import parameters
from commissioner.report.diagnosis.words import headline, next_promise, next_sentence
from commissioner.report.page import picture
from commissioner.report.sheet.words import quantity_name

PERIOD, SAMPLES, SIGMA = 2.5e-4, 4000, 0.01
TONES = (4.0, 20.0, 90.0)
TRUE = (2.0, 1.5, 0.01, 0.2)


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ({"value": 1.69412, "std": 0.0213, "unit": "us"}, "1.694 ± 0.042 µs"),
        ({"value": 0.11623, "std": 0.00402, "unit": "1"}, "11.62 ± 0.79 %"),
        ({"value": 123456.0, "std": 1234.0, "unit": "rad/s"}, "123500 ± 2400 rad/s"),
        ({"value": 0.5, "std": None, "unit": "A"}, "0.5000 A"),
        ({"value": 3.1e-7, "std": 1e-9, "unit": "F"}, "3.1e-07 ± 2e-09 F"),
    ],
)  # fmt: skip
def test_a_size_has_the_digits_of_its_interval(entry, words):
    assert quantity(entry) == words


def test_a_sizes_name_keeps_the_phase_and_loses_the_unit():
    keys = ("offset_v_a", "half_current_a", "gain_w_over_u", "amplitude_50_hz_a", "drift_u_a_per_min", "voltage_v")
    assert [quantity_name(k) for k in keys] == [
        "offset v",
        "half current",
        "w against u",
        "amplitude 50 Hz",
        "drift u",
        "voltage",
    ]


def test_numbers_have_no_tails_and_nothing_is_certain():
    assert number(0.00012345) == "0.0001234" and number(27.1234567) == "27.12" and number(0.0, 2) == "0"
    assert percent(0.99999) == "over 99.9 %" and percent(0.0002) == "under 0.1 %" and percent(0.446) == "44.6 %"
    assert sure(1.0) == "over 99 %" and sure(0.83) == "83 %"
    assert [part_word(s, 0.83) for s in (0.83, 0.3, 0.02, 0.002)] == ["main", "large", "small", "tiny"]


def test_a_detection_limit_is_read_in_the_unit_of_its_size():
    limits = {
        "sensor_offset": {"u_a": {"value": 7.1e-5, "unit": "A"}},
        "dc_link_sag": {"sag": {"value": 0.0012, "unit": "1"}},
    }
    document = {"detection_limits": limits}
    assert limit_words(document, "sensor_offset") == "71 µA"
    assert limit_words(document, "dc_link_sag") == "0.12 %"
    assert limit_words(document, "clipping") == "-"


def test_a_next_experiment_promises_only_what_was_predicted():
    plan = {"splits": ["sampling_delay", "sensor_lag"], "do": "excite higher lines", "predicted_sigma": None}
    assert next_sentence(plan) == "To tell sampling delay from sensor lag: excite higher lines."
    assert "times its own uncertainty" not in next_promise(plan)
    assert "more than 100 times" in next_promise(plan | {"predicted_sigma": 843.2, "repeats": 1})


def test_a_refusal_has_a_headline():
    assert "cannot carry" in headline(
        refused_document(refused("too short", 3, "at least 5", "record longer"), "recording")
    )


def screening(gram):
    """Three causes of one number each with these products of their directions."""
    names = ("sampling_delay", "sensor_lag", "remanence")
    terms = [Term(n, n, "1", 0, 0, 1.0) for n in names]
    scores = {n: Score(n, 1.0, 1, np.ones(1), (t,)) for n, t in zip(names, terms, strict=True)}
    zero = np.zeros((1, 1))
    normal = Normal(zero, zero, zero, zero)
    return Screening(scores, np.array(gram), np.ones(3), {n: (k,) for k, n in enumerate(names)}, normal)


def test_causes_that_look_alike_are_shown_together_and_others_stand_alone():
    seen = look_alikes(screening([[4.0, 0.0, 1.98], [0.0, 1.0, 0.0], [1.98, 0.0, 1.0]]))
    assert set(seen.names) == {"sampling_delay", "remanence"} and seen.alone == ("sensor_lag",)
    assert seen.share[0, 1] == pytest.approx(0.99**2) and np.all(np.diag(seen.share) == 1.0)


def test_a_named_cause_is_shown_though_it_stands_alone():
    seen = look_alikes(screening(np.eye(3)), ["remanence"])
    assert seen.names == ("remanence",) and len(seen.alone) == 3


@pytest.fixture(scope="module")
def seen():
    return seen_by(3)


def seen_by(sensors):
    """Residuals of a true and of a wrong model (R_R 20 % off) on a multisine with white noise and one masked stretch."""
    from commissioner.diagnose.plant.prediction import predict

    time = PERIOD * np.arange(SAMPLES)
    voltage = sum(5.0 * np.sin(2 * np.pi * f * time + k) for k, f in enumerate(TONES))
    good = np.ones(SAMPLES, bool)
    good[1000:1010] = False
    random = np.random.default_rng(4)
    facts = Facts(PERIOD, 5.0, 1500.0, 0.8, 5.0, 4000.0, 540.0, sensors)
    segments = []
    for k, axis in enumerate((0.0, 60.0)):
        segment = Segment(k, 0, axis, time + 2.0 * k, voltage, np.zeros((sensors, SAMPLES)), good, np.ones(SAMPLES))
        current = predict(Model(TRUE), Record((segment,), facts), 0, NO_DICTIONARY).currents_a
        noisy = current + SIGMA * random.standard_normal(current.shape)
        noisy[:, ~good] = 99.0
        segments.append(Segment(k, 0, axis, time + 2.0 * k, voltage, noisy, good, np.ones(SAMPLES)))
    flat = np.array([1.0, 1000.0])
    noise = Noise(np.full(sensors, SIGMA), flat, np.ones((sensors, 2)), "test", True, 0.01, True)
    wrong = Model((TRUE[0], 1.2 * TRUE[1], TRUE[2], TRUE[3]))
    return residuals(Record(tuple(segments), facts), NO_DICTIONARY, wrong, Model(TRUE), noise, TONES)


def test_noise_alone_stays_in_the_correlation_band_and_a_wrong_resistance_does_not(seen):
    tie = seen.correlation
    assert np.mean(np.abs(tie.after) < figures.BAND) > 0.9
    assert np.sqrt(np.mean(tie.after**2)) < 1.8
    assert np.abs(tie.before).max() > 20.0


def test_the_error_of_a_wrong_resistance_is_at_the_excited_lines_and_noise_is_one_everywhere(seen):
    by_class = seen.spectrum.by_class
    assert by_class["excited"][0] > 10.0 and by_class["odd"][0] < 3.0
    assert by_class["other"][1] == pytest.approx(1.0, abs=0.05)
    assert by_class["excited"][1] < 2.5


def test_masked_samples_make_no_error(seen):
    assert seen.time_after_a.max() < 1.2 * SIGMA
    assert seen.by_axis_after_a == pytest.approx(SIGMA, rel=0.05)


@pytest.mark.parametrize("sensors", [2, 3])
def test_what_is_left_against_the_flux_is_the_noise_on_every_axis(sensors):
    flux = next(c for c in seen_by(sensors).curves if "flux" in c.label)
    assert flux.after_a == pytest.approx(SIGMA, rel=0.2) and np.mean(flux.after_a) == pytest.approx(SIGMA, rel=0.02)


@pytest.mark.parametrize("has_causes", [True, False])
def test_without_causes_only_the_error_as_it_is_is_drawn(seen, has_causes):
    figure = figures.correlation(seen.correlation, has_causes)
    labels = {text.get_text() for text in figure.legends[0].get_texts()}
    assert (figures.AFTER in labels) == has_causes
    assert picture(figures.spectrum(seen.spectrum, TONES, has_causes), "x").markup.startswith("<svg")


def test_dense_tones_leave_excited_lines_and_others(seen):
    from commissioner.diagnose.intake.line_classes import class_bins

    bins = class_bins(np.arange(1.0, 60.0, 2.0), SAMPLES, PERIOD)
    assert set(bins) == {"excited"} and bins["excited"].size == 30


@pytest.mark.parametrize(
    ("before", "said"), [(3.0 * (1.0 + 1.25e-9), "nothing"), (3.0375, "+1.25 %"), (2.9997, "-0.0100 %")]
)
def test_what_the_plain_simulation_was_off_by_is_told_without_an_exponent(before, said):
    values = {
        "parameters_before": {"stator_resistance_ohm": {"value": before, "std": 0.01}},
        "parameters_after": {"stator_resistance_ohm": {"value": 3.0, "std": 0.01}},
    }
    assert parameters({"causes": [], "kind": "standstill", **values}).parts[-1].rows[0][-1].startswith(said)


def test_a_logarithmic_axis_of_less_than_a_decade_has_no_exponents():
    drawn = page.figure_of(1, 1, 2.0)[1][0, 0]
    drawn.set_yscale("log")
    drawn.set_ylim(0.3, 3.0)
    page.plain_decades(drawn.yaxis)
    drawn.figure.draw_without_rendering()
    said = [label.get_text() for label in drawn.get_yticklabels(which="both")]
    assert {"0.5", "1", "2"} <= set(said)
    assert not any("10" in label for label in said)
