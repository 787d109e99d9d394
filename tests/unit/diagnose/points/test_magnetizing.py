"""The magnetizing branch beside a locked rotor: inverse-Gamma machines come back as they are."""

import numpy as np
import pytest

from commissioner.diagnose.points.diagnosis import diagnose_points
from commissioner.diagnose.points.magnetizing import GROWTH, OF_ONE_VA, SPREAD
from commissioner.diagnose.points.table import read_points
from tests.support.standstill import usable_motors

MOTORS = list(usable_motors())
SMALL = [m for m in MOTORS if m.plate.rated_power_w < 400.0]


def impedance(motor, frequency_hz):
    """Of an inverse-Gamma machine at rest."""
    r_s, r_r, leak, main = motor.truth
    jw = 2j * np.pi * np.asarray(frequency_hz)
    return r_s + jw * leak + 1.0 / (1.0 / (jw * main) + 1.0 / r_r)


def table(motor, shares, scatter=0.0, seed=0):
    """Five currents at every share of the rated frequency."""
    random = np.random.default_rng(seed)
    f = np.repeat(shares, 5) * motor.plate.rated_frequency_hz
    i = np.tile(np.linspace(0.4, 1.0, 5), len(shares)) * motor.plate.rated_current_a
    z = impedance(motor, f)
    v, i, p = (
        x * (1.0 + scatter * random.standard_normal(f.size))
        for x in (np.sqrt(3.0) * i * abs(z), i, 3.0 * i**2 * z.real)
    )
    return {
        "frequency_hz": f, "voltage_line_v": v, "current_line_a": i, "power_w": p,
        "winding_resistance_uv_ohm": np.full(f.size, 2.0 * motor.truth[0]),
    }  # fmt: skip


def test_the_ratio_of_published_machines_is_the_one_taken():
    size = [3.0 * m.plate.rated_current_a**2 * abs(impedance(m, m.plate.rated_frequency_hz)) for m in MOTORS]
    ratio = np.log([m.truth[3] / m.truth[2] for m in MOTORS])
    growth, offset = np.polyfit(np.log(size), ratio, 1)
    assert (np.exp(offset), growth) == (pytest.approx(OF_ONE_VA, rel=0.01), pytest.approx(GROWTH, abs=0.002))
    assert np.std(ratio - offset - growth * np.log(size), ddof=2) < SPREAD


@pytest.mark.parametrize("shares", [(1.0, 0.5), (1.0, 0.25), (1.0,)])
@pytest.mark.parametrize("motor", MOTORS[::4] + SMALL, ids=lambda m: m.name)
def test_exact_points_give_the_machine_within_its_stated_error(motor, shares):
    found = diagnose_points(read_points(table(motor, shares), "locked"))
    _, r_r, leak, _ = motor.truth
    for parameters in (found.parameters_before, found.parameters_after):
        seen, said = parameters["leakage_inductance_h"], parameters["rotor_resistance_ohm"]
        assert seen.value == pytest.approx(leak, abs=3.0 * seen.std + 1e-4 * leak) and seen.std < 0.02 * leak
        assert said.value == pytest.approx(r_r, abs=3.0 * said.std + 1e-4 * r_r)
    assert found.parameters_before["rotor_resistance_ohm"].std < 0.02 * r_r
    assert found.verdict == "nothing_significant"


@pytest.mark.parametrize("motor", SMALL, ids=lambda m: m.name)
def test_leakage_of_noisy_points_lies_within_its_stated_error(motor):
    off = []
    for seed in range(8):
        found = diagnose_points(read_points(table(motor, (1.0, 0.5), 0.003, seed), "locked"))
        seen = found.parameters_after["leakage_inductance_h"]
        off.append((seen.value - motor.truth[2]) / seen.std)
    assert np.sqrt(np.mean(np.square(off))) < 1.5


@pytest.mark.parametrize("motor", MOTORS[::4], ids=lambda m: m.name)
def test_without_the_stators_resistance_the_sum_and_the_leakage_are_those_of_the_machine(motor):
    columns = {k: v for k, v in table(motor, (1.0, 0.5)).items() if k != "winding_resistance_uv_ohm"}
    found = diagnose_points(read_points(columns, "locked"))
    r_s, r_r, leak, _ = motor.truth
    assert found.parameters_after["leakage_inductance_h"].value == pytest.approx(leak, rel=0.01)
    assert found.parameters_after["total_resistance_ohm"].value == pytest.approx(r_s + r_r, rel=0.01)
