"""The ohms of a points table: of a winding, between terminals, of a star phase; right, or asked for, never a silent factor."""

from pathlib import Path

import numpy as np
import pytest

from commissioner.diagnose.intake.points import Points
from commissioner.diagnose.points.diagnosis import diagnose_points
from commissioner.diagnose.points.table import read_points
from commissioner.errors import DataRefused
from commissioner.operations.recordings.diagnose import DiagnoseRequest, diagnose
from tests.support.standstill import usable_motors

DATA = Path(__file__).parents[3] / "data" / "intake"
MOTORS = list(usable_motors())
FACTOR = {("star", "line_to_line"): 2.0, ("delta", "line_to_line"): 2.0, ("star", "phase_winding"): 1.0,
          ("delta", "phase_winding"): 3.0, ("star", "star_equivalent"): 1.0, ("delta", "star_equivalent"): 1.0}  # fmt: skip


def table(motor, ohm, name="resistance_ohm"):
    r_s, r_r, leak, main = motor.truth
    f = np.repeat([25.0, 50.0], 4)
    i = np.tile([0.4, 0.6, 0.8, 1.0], 2) * motor.plate.rated_current_a
    branch = 2j * np.pi * f * main
    z = r_s + 2j * np.pi * f * leak + r_r * branch / (r_r + branch)
    columns = {
        "frequency_hz": f,
        "voltage_line_v": np.sqrt(3) * i * abs(z),
        "current_line_a": i,
        "power_w": 3 * i**2 * z.real,
    }
    return columns | {name: np.full(8, ohm)}


def plate(motor, connection):
    p = motor.plate
    return {
        "connection": connection, "rated_voltage_v": p.rated_voltage_v, "rated_current_a": p.rated_current_a,
        "rated_speed_rpm": p.rated_speed_rpm, "rated_frequency_hz": p.rated_frequency_hz, "pole_pairs": float(p.pole_pairs),
    }  # fmt: skip


@pytest.mark.parametrize(("connection", "kind"), FACTOR)
def test_a_told_kind_gives_the_star_resistance_of_every_published_machine(connection, kind):
    for motor in MOTORS:
        columns = table(motor, FACTOR[connection, kind] * motor.truth[0])
        seen = read_points(columns, "locked", plate(motor, connection) | {"resistance_measured": kind})
        assert isinstance(seen, Points), (motor.name, seen)
        np.testing.assert_allclose(seen.resistance_ohm, motor.truth[0], rtol=1e-9)


@pytest.mark.parametrize("has_plate", [True, False])
@pytest.mark.parametrize(("connection", "kind"), FACTOR)
@pytest.mark.parametrize("name", ["resistance_ohm", "winding_resistance_ohm"])
def test_an_untold_kind_is_right_or_asked_for_and_never_a_silent_factor(connection, kind, name, has_plate):
    answered = 0
    for motor in MOTORS:
        columns = table(motor, FACTOR[connection, kind] * motor.truth[0], name)
        seen = read_points(columns, "locked", plate(motor, connection) if has_plate else {})
        if isinstance(seen, DataRefused):
            assert "resistance_measured" in seen.remedy
            continue
        answered += 1
        np.testing.assert_allclose(seen.resistance_ohm, motor.truth[0], rtol=1e-9, err_msg=motor.name)
        assert any("was taken as" in remark for remark in seen.remarks)
    assert answered or (connection, kind) != ("delta", "phase_winding")


def test_a_delta_windings_own_resistance_gives_what_its_terminals_give():
    """The answer key: R_R 20.54 ohm; halved in silence the column would leave 5.0."""
    ohms = []
    for file in ("delta_winding.csv", "delta_terminals.csv"):
        document = diagnose(DiagnoseRequest((DATA / file,))).document
        ohms.append(document["parameters_after"]["rotor_resistance_ohm"]["value"])
    assert ohms[0] == pytest.approx(ohms[1], rel=1e-6)
    assert ohms[0] == pytest.approx(20.54, rel=0.05)


def test_a_resistance_in_the_comments_counts_as_one_in_a_column():
    motor = MOTORS[3]
    columns = table(motor, 2.0 * motor.truth[0])
    ohm = columns.pop("resistance_ohm")[0]
    seen = read_points(columns, "x", {"resistance_ohm": float(ohm), "resistance_measured": "line_to_line"})
    np.testing.assert_allclose(seen.resistance_ohm, motor.truth[0])


def test_what_contradicts_is_refused_with_both_values():
    motor = MOTORS[3]
    for columns, said in (
        (table(motor, 2.0 * motor.truth[0], "winding_resistance_uv_ohm"), {"resistance_measured": "phase_winding"}),
        (table(motor, 20.0 * motor.truth[0]), {"resistance_measured": "line_to_line"}),
        (table(motor, 2.0 * motor.truth[0]), {"resistance_measured": "between the teeth"}),
        (table(motor, 3.0 * motor.truth[0]), {"resistance_measured": "phase_winding"}),
    ):
        seen = read_points(columns, "x", said)
        assert isinstance(seen, DataRefused) and seen.value and seen.limit and seen.remedy
    assert (
        diagnose_points(read_points(table(motor, 2 * motor.truth[0], "winding_resistance_uv_ohm"), "x")).causes
        is not None
    )


@pytest.mark.parametrize("motor", MOTORS[::6], ids=lambda motor: motor.name[:20])
def test_what_a_winding_that_was_measured_cold_adds_to_the_rotor_is_told(motor):
    """Truth: R_s 10 K below the test's, from a closed form; constant bars."""
    cold = motor.truth[0] / (1.0 + 10.0 / 259.5)
    seen = read_points(table(motor, 2.0 * cold, "winding_resistance_uv_ohm"), "locked", {})
    said = next(remark for remark in seen.remarks if remark.startswith("One winding resistance"))
    share = float(said.split(" are ")[1].split("%")[0])
    rotor = [
        diagnose_points(read_points(table(motor, 2.0 * ohm, "winding_resistance_uv_ohm"), "locked", {}))
        for ohm in (cold, motor.truth[0])
    ]
    shifted, true = (found.parameters_after["rotor_resistance_ohm"].value for found in rotor)
    assert share == pytest.approx(100.0 * (shifted / true - 1.0), rel=0.15, abs=0.1)


def test_a_resistance_that_was_measured_at_every_point_leaves_no_warming_open():
    columns = table(MOTORS[0], 1.0, "winding_resistance_uv_ohm")
    columns["winding_resistance_uv_ohm"] = 2.0 * MOTORS[0].truth[0] * np.linspace(1.0, 1.02, 8)
    assert not any("One winding resistance" in remark for remark in read_points(columns, "locked", {}).remarks)
