"""A run's result in other programs' forms: read back by those programs' own readers, played by motulator itself."""

import csv
import importlib.util
import io
import json

import numpy as np
import pytest
from scipy.io import loadmat

from commissioner.errors import DataRefused, UsageError
from commissioner.export.forms import FORMS, form_named
from commissioner.export.found import found_in
from commissioner.motor.circuit import Gamma, InverseGamma, to_t_model
from commissioner.motor.standstill import held_input

MACHINE = InverseGamma(3.7, 2.1, 0.0214, 0.310)
PLATE = {
    "rated_power_w": 2200.0,
    "rated_frequency_hz": 50.0,
    "pole_pairs": 2,
    "connection": "star",
    "inertia_kg_m2": None,
}
PERIOD_S = 1e-4


def result(curve=()):
    names = ("stator_resistance_ohm", "rotor_resistance_ohm", "leakage_inductance_h", "magnetizing_inductance_h")
    parameters = {name: {"value": v, "std": 1e-3 * v} for name, v in zip(names, MACHINE.as_tuple(), strict=True)}
    parameters["rotor_time_constant_s"] = {"value": MACHINE.rotor_time_constant_s, "std": 1e-4}
    t = to_t_model(MACHINE)
    model = {n: {"value": getattr(t, n).value, "std": 0.0} for n in (
        "stator_resistance_ohm", "rotor_resistance_ohm", "stator_leakage_h", "rotor_leakage_h", "magnetizing_inductance_h",
    )}  # fmt: skip
    return {
        "run": "20260101-000000-x", "outcome": "commissioned", "parameters": parameters, "t_model": model | {"assumption": t.assumption},
        "holds_for_stator_flux_wb": 0.7, "inverter": {"leg_current_a": [0.0, 1.0], "leg_voltage_v": [0.0, 7.9]},
        "delay_s": {"value": 1e-5, "std": 1e-7},
        "magnetizing_curve": [{"stator_flux_wb": a, "magnetizing_inductance_h": {"value": b, "std": 1e-4}} for a, b in curve],
        "written": [
            {"name": "stator_resistance", "field": "stator_resistance_ohm", "register": 576, "before": 3.2, "after": 3.7, "read_back": 3.7}
        ],
    }  # fmt: skip


def written(name, curve=()):
    return FORMS[name].write(found_in(result(curve), PLATE, "2026-01-01T00:00:00"))


def test_the_parameter_list_has_each_value_once_with_its_register():
    text = written("csv").decode()
    rows = list(csv.DictReader(io.StringIO("\n".join(line for line in text.split("\n") if not line.startswith("#")))))
    by_name = {row["name"]: row for row in rows if row["circuit"] == "inverse-Gamma"}
    assert float(by_name["stator_resistance_ohm"]["value"]) == MACHINE.stator_resistance_ohm
    assert by_name["stator_resistance_ohm"]["register"] == "576"
    assert by_name["rotor_resistance_ohm"]["register"] == ""
    assert float(by_name["magnetizing_inductance_h"]["at_stator_flux_wb"]) == 0.7
    assert json.loads(written("json"))["parameters"][0]["value"] == MACHINE.stator_resistance_ohm


def test_matlabs_struct_has_every_circuit(tmp_path):
    (tmp_path / "m.mat").write_bytes(written("matlab", ((0.1, 0.32), (0.8, 0.30))))
    motor = loadmat(tmp_path / "m.mat", simplify_cells=True)["motor"]
    assert motor["inverse_gamma"]["L_M"] == MACHINE.magnetizing_inductance_h
    assert motor["gamma"]["L_s"] == pytest.approx(MACHINE.magnetizing_inductance_h + MACHINE.leakage_inductance_h)
    assert motor["T"]["L_ls"] == pytest.approx(to_t_model(MACHINE).stator_leakage_h.value)
    assert motor["curve_L_M_h"].tolist() == [0.32, 0.30]
    assert motor["T_assumption"].startswith("equal leakage")


def test_modelicas_record_is_balanced_and_names_the_assumption():
    text = written("modelica").decode()
    name = text.split()[1]
    assert text.rstrip().endswith(f"end {name};")
    assert f"Lssigma = {to_t_model(MACHINE).stator_leakage_h.value!r}" in text
    assert "equal leakage" in text


def test_the_curve_in_gamma_form_is_the_same_machine_at_every_flux():
    found = found_in(result(((0.1, 0.320), (0.7, 0.310), (0.8, 0.298))), PLATE, "")
    for (_, l_m), (_, l_s) in zip(found.curve, found.stator_curve, strict=True):
        back = Gamma(
            MACHINE.stator_resistance_ohm, found.gamma.rotor_resistance_ohm, found.gamma.leakage_inductance_h, l_s
        )
        assert back.as_inverse_gamma().magnetizing_inductance_h == pytest.approx(l_m, rel=1e-12)


@pytest.mark.parametrize("curve", [(), ((0.05, 0.310), (0.4, 0.310), (0.9, 0.310))])
def test_motulator_plays_the_module_to_the_closed_forms_currents(tmp_path, curve):
    (tmp_path / "motor_of_run.py").write_bytes(written("motulator", curve))
    spec = importlib.util.spec_from_file_location("motor_of_run", tmp_path / "motor_of_run.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    voltage = 30.0 * np.sin(2 * np.pi * 12.0 * PERIOD_S * np.arange(1500)) + 4.0
    theirs, ours = _motulator(module.par, voltage), _closed_form(voltage)
    assert np.max(np.abs(theirs - ours)) < 2e-3 * np.max(np.abs(ours))


def _closed_form(voltage):
    """The exact discrete circuit of `motor.standstill`."""
    step, gain = held_input(MACHINE, PERIOD_S)
    state, out = np.zeros(2), []
    for u in voltage:
        out.append(state[0])
        state = step @ state + gain * u
    return np.array(out)


def _motulator(par, voltage):
    """motulator's own machine, at rest, with the voltage held over each period; the midpoint rule in tenths of it."""
    from motulator.drive.model import InductionMachine

    machine = InductionMachine(par)
    h = PERIOD_S / 10

    def rates(state, u):
        machine.state.psi_ss, machine.state.psi_rs = state
        machine.inp.u_ss, machine.inp.w_M = u, 0.0
        machine.set_outputs(0.0)
        return np.array(machine.rhs())

    state, out = np.zeros(2, dtype=complex), []
    for u in voltage:
        machine.state.psi_ss, machine.state.psi_rs = state
        out.append(machine.i_ss.real)
        for _ in range(10):
            state = state + h * rates(state + 0.5 * h * rates(state, u), u)
    return np.array(out)


def test_a_run_that_was_not_accepted_exports_no_model():
    with pytest.raises(DataRefused) as refused:
        found_in(result() | {"outcome": "rejected"}, PLATE, "")
    assert "--form samples" in refused.value.remedy


@pytest.mark.parametrize(("form", "name"), [("simulink", "a.mat"), ("matlab", "a.txt")])
def test_an_unknown_form_or_ending_is_a_usage_error(form, name, tmp_path):
    with pytest.raises(UsageError) as refused:
        form_named(form, tmp_path / name)
    assert refused.value.limit
