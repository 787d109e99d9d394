"""R_R at running slip from locked-rotor points: two cages, deep bars, constant bars; one frequency says what it cannot tell."""

from pathlib import Path

import numpy as np
import pytest

from commissioner.diagnose.points.bars import slow_rotor
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


def test_one_frequency_says_that_it_cannot_tell():
    rows = np.loadtxt(DATA / "two_cages.csv", delimiter=",", skiprows=1)
    rows = np.vstack([rows[:3], rows[:3] * [1, 0.8, 0.8, 0.64, 1], rows[:3] * [1, 0.9, 0.9, 0.81, 1]])
    names = ("frequency_hz", "voltage_line_v", "current_line_a", "power_w", "winding_resistance_uv_ohm")
    points = read_points(dict(zip(names, rows.T, strict=True)), "locked")
    assert slow_rotor(points) is None
    from commissioner.diagnose.points.diagnosis import diagnose_points

    assert any("cannot tell the rotor at slip frequency" in r for r in diagnose_points(points).points.remarks)


def test_draws_of_deep_bars_and_cages_lie_within_their_stated_error():
    random = np.random.default_rng(5)
    inside = []
    for _ in range(12):
        points, true = draw(random)
        found = slow_rotor(points)
        inside.append(abs(found.resistance_ohm - true) < 2.5 * found.std_ohm)
    assert np.mean(inside) >= 0.8
