"""The page of a monitored recording: one interval throughout, and what swings told peak to peak."""

from types import SimpleNamespace

import numpy as np
import pytest

from commissioner.cli.screens.screen import quantity, share
from commissioner.monitor.result import cannot_be_fixed
from commissioner.monitor.trend.trend import State, Verdict, Watched
from commissioner.records import RPM, in_words
from commissioner.report.monitoring import page
from commissioner.report.monitoring.figures import resimulation, superimposed
from commissioner.report.page import BLUE, GREEN, ORANGE, PURPLE, RED

SEEN = SimpleNamespace(
    period=SimpleNamespace(speed_rad_per_s=np.array([150.0 - 1.5 / RPM, 150.0 + 1.5 / RPM])), findings=(),
    mean_speed_rad_per_s=1437.0 / RPM, mean_speed_std=0.5 / RPM, mean_torque_nm=14.6, mean_torque_std=0.1,
    mean_torque_sensor_std=0.05, slip=0.04, lines=SimpleNamespace(supply_rad_per_s=314.0),
    proof=SimpleNamespace(relative_rms=0.01), inertia_kg_m2=None,
)  # fmt: skip


def test_what_swings_is_told_peak_to_peak_and_never_as_an_interval():
    headline = page._headline(SEEN, None)
    assert "moving by 3.00 1/min peak to peak" in headline
    assert "±" not in headline


def test_means_have_the_95_percent_interval_of_every_other_report():
    facts = dict(page._facts(SEEN, None))
    assert facts["mean speed"] == "1437.00 ± 0.98 1/min"
    assert facts["mean torque"] == "14.60 ± 0.20 N m (± 0.098 of it by sensor gain)"


def test_the_terminal_says_the_same_interval():
    assert quantity(1437.0, 0.5, "1/min") == "1437.00 ± 0.98 1/min"
    assert quantity(1.0, None, "N m") == "1 N m"
    assert share({"value": -2.0, "std": 0.1}) == "9.8 %"
    assert share({"value": 2.0, "std": None}) == "not known"


def test_no_key_of_an_indicator_is_shown():
    watched = Watched("load_torque_ripple_nm", 2.0, 1.0, 0.1, 9.0, 4.0)
    assert "(load torque ripple)" in page._headline(SEEN, Verdict(State.ALARM, 5, (watched,)))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("load_torque_ripple_nm", ("load torque ripple", "N m")),
        ("pulse_dissimilarity_percent", ("pulse dissimilarity", "%")),
        ("tone", ("tone", "")),
    ],
)
def test_an_indicator_has_its_unit(name, words):
    assert in_words(name) == words


def test_the_least_known_has_the_interval_of_the_table_above_it():
    fitted = SimpleNamespace(
        open_direction=np.array([1.0, 0.0, 0.0, 0.0]), log_covariance=0.01 * np.eye(4), open_share=0.1
    )
    found = cannot_be_fixed(fitted)
    assert found["relative_std"] == pytest.approx(0.1)
    assert "to ± 19.6%" in found["sentence"]


def lightness(colour):
    """CIE 1976 L* of an sRGB colour (IEC 61966-2-1)."""
    linear = [
        c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4
        for c in (int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
    ]
    return 116 * float(np.dot((0.2126, 0.7152, 0.0722), linear)) ** (1 / 3) - 16


def test_colours_are_told_apart_in_a_grey_print_and_are_seen_on_paper():
    """All five lay within 14 L*, blue, red and purple within 0.4."""
    seen = sorted(lightness(colour) for colour in (BLUE, ORANGE, GREEN, RED, PURPLE))
    assert np.diff(seen).min() > 9
    assert 1.05 / (((seen[-1] + 16) / 116) ** 3 + 0.05) > 3  # WCAG 2.1, 1.4.11: what is drawn against white


def test_pulses_of_a_turn_differ_in_more_than_colour():
    (panel,) = superimposed(SimpleNamespace(curves=np.arange(12.0).reshape(6, 2), per_turn=6)).axes
    assert len({line._unscaled_dash_pattern for line in panel.lines}) == 6


def test_measured_and_simulated_differ_in_width():
    proof = SimpleNamespace(time_s=np.arange(9.0), measured_a=np.zeros(9) + 0j, simulated_a=np.ones(9) + 0j)
    loads = [SimpleNamespace(frequency_hz=0.1)]
    drawn = resimulation(SimpleNamespace(proof=proof, load_periods=loads, audited=SimpleNamespace(sample_period_s=1.0)))
    measured, simulated = drawn.axes[0].lines
    assert measured.get_linewidth() > 2 * simulated.get_linewidth()
