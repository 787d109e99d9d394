"""R_R at running slip from locked-rotor points: two cages, deep bars, constant bars; one frequency says what it cannot tell."""

from pathlib import Path

import numpy as np
import pytest

from commissioner.diagnose.points.bars import _Fit, _impedance, slow_rotor
from commissioner.diagnose.points.diagnosis import diagnose_points
from commissioner.diagnose.points.table import read_points
from commissioner.operations.recordings.diagnose import DiagnoseRequest, diagnose
from tests.campaigns.intake.bars import draw

DATA = Path(__file__).parents[3] / "data" / "intake"


def test_two_cages_are_named_and_give_the_slow_rotor():
    """Closed form: 0.561 ohm; a single cage read at 50 Hz has 0.877."""
    document = diagnose(DiagnoseRequest((DATA / "two_cages.csv",))).document
    found = document["parameters_after"]["rotor_resistance_ohm"]
    assert found["value"] == pytest.approx(0.561, abs=max(2.0 * found["std"], 0.003)) and found["std"] < 0.03
    assert document["verdict"] == "explained" and "rotor_skin_effect" in {c["name"] for c in document["causes"]}
    assert any("running slip" in remark for remark in document["remarks"])


def _two_cages(frequencies):
    """Exact points of 0.42 ohm and 3 mH before 110 mH, 2 ohm / 1 mH and 0.5 ohm / 9 mH in parallel."""
    f = np.repeat(frequencies, 3).astype(float)
    i, w = np.tile([8.0, 12.0, 16.0], len(frequencies)), 2j * np.pi * f
    z = 0.42 + w * 3e-3 + 1.0 / (1.0 / (w * 0.11) + 1.0 / (2.0 + w * 1e-3) + 1.0 / (0.5 + w * 9e-3))
    return {
        "frequency_hz": f, "voltage_line_v": np.sqrt(3.0) * i * abs(z), "current_line_a": i, "power_w": 3.0 * i**2 * z.real,
        "winding_resistance_uv_ohm": np.full(f.size, 0.84),
    }  # fmt: skip


@pytest.mark.parametrize("frequencies", [(50, 25, 12.5), (60, 15), (50, 12.5)])
def test_exact_points_of_two_cages_are_explained_and_foretold(frequencies):
    found = diagnose_points(read_points(_two_cages(frequencies), "locked"))
    assert found.verdict == "explained" and [c.name for c in found.causes] == ["rotor_skin_effect"]
    assert found.relative_after < 0.002
    assert found.relative_before > 0.03
    slow, r_r = 1.0 / (1.0 / 2.0 + 1.0 / 0.5), found.parameters_after["rotor_resistance_ohm"]
    leak = (1e-3 / 2.0**2 + 9e-3 / 0.5**2) * slow**2
    assert r_r.value == pytest.approx(slow * (0.11 / (0.11 + leak)) ** 2, abs=3.0 * r_r.std)


def test_the_error_of_a_point_left_out_is_that_of_the_fit_without_it():
    columns = _two_cages((50, 25, 12.5))
    columns["power_w"] = columns["power_w"] * (1.0 + 0.02 * np.random.default_rng(3).standard_normal(9))
    points = read_points(columns, "locked")
    z, keep = _impedance(points), np.arange(9) != 4
    rest = read_points({n: v[keep] for n, v in columns.items()}, "locked")
    without = _Fit(rest, z[keep], 0.01, "cages")
    whole = _Fit(points, z, 0.01, "cages")
    np.testing.assert_allclose(whole.left_out[4], whole.relative(whole.predicted(without.x))[4], atol=0.004)
    assert np.max(abs(whole.left_out[4])) > 1.05 * np.max(abs(whole.fitted[4]))


def test_points_of_two_motors_are_not_explained_by_bars():
    columns = _two_cages((50, 25, 12.5))
    columns["voltage_line_v"] = columns["voltage_line_v"] * np.where(columns["current_line_a"] == 12.0, 1.6, 1.0)
    found = diagnose_points(read_points(columns, "locked"))
    assert found.verdict == "unexplained" and found.causes == ()


def test_one_frequency_says_that_it_cannot_tell():
    rows = np.loadtxt(DATA / "two_cages.csv", delimiter=",", skiprows=1)
    rows = np.vstack([rows[:3], rows[:3] * [1, 0.8, 0.8, 0.64, 1], rows[:3] * [1, 0.9, 0.9, 0.81, 1]])
    names = ("frequency_hz", "voltage_line_v", "current_line_a", "power_w", "winding_resistance_uv_ohm")
    points = read_points(dict(zip(names, rows.T, strict=True)), "locked")
    assert slow_rotor(points) is None
    assert any("cannot tell the rotor at slip frequency" in r for r in diagnose_points(points).points.remarks)


def test_draws_of_deep_bars_and_cages_lie_within_their_stated_error():
    random = np.random.default_rng(5)
    inside = []
    for _ in range(12):
        points, true = draw(random)
        found = slow_rotor(points)
        inside.append(abs(found.resistance_ohm - true) < 2.5 * found.std_ohm)
    assert np.mean(inside) >= 0.8
