"""The running machine's kernel: its derivatives are exact, its currents are those of the closed form and of another's machine."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from commissioner.estimation.kernels.march import STATES, UNSET, Directions, Load, march, tangents
from commissioner.estimation.numbers import AT, COUNT, DEFAULTS, NAMES, Scales

SCALES = Scales(11.7, 326.6, 314.16, 26.0, 2)
PERIOD = 2e-4
ROOT = Path(__file__).resolve().parents[3]
SPOKEN = {
    "stator_saturation_2": 0.1, "rotor_saturation_1": 0.05, "gap_saturation_2": 0.04, "leakage_softness": 0.2, "leakage_bend": 0.1, "bar_resistance": 0.3,
    "iron_conductance": 0.02, "stator_heat": 0.02, "rotor_heat": 0.03, "cage_asymmetry_re": 0.01, "cage_asymmetry_im": 0.02,
    "loop_conductance_v": 0.03, "loop_susceptance_v": 0.01, "line_re": 0.02, "line_im": -0.01, "dead_voltage": 0.005,
    "voltage_gain_re": 0.002, "voltage_gain_im": 0.003, "voltage_offset_re": 1e-4, "speed_gain": 0.001, "speed_lag": 1e-3,
    "speed_ripple_cos": 1e-3, "delay": 5e-5, "current_gain_v": 0.01, "current_gain_w": -0.02, "current_offset_u": 0.005,
    "load_swing_cos": 0.04, "load_swing_sin": -0.02, "load_swing_turns": 1.618,
}  # fmt: skip


def numbers(extra):
    p = np.zeros(COUNT)
    p[:4] = [1.32, 1.02, 0.0118, 0.168]
    for name, value in {**DEFAULTS, "inertia": 0.05, **extra}.items():
        p[AT[name]] = value
    return p


def forcing(count, speed_rad_per_s=300.0):
    t = 0.5 * PERIOD * np.arange(2 * count - 1)
    voltage = 326.6 * np.stack([np.cos(314.16 * t) + 0.01 * np.cos(1570.8 * t), np.sin(314.16 * t)], axis=1)
    return voltage, np.stack([speed_rad_per_s + 20.0 * t, np.full(t.size, 20.0)], axis=1)


def run(p, count, *, is_free, start=None, speed=300.0):
    voltage, w = forcing(count, speed)
    out, shaft = np.empty((count, 3)), np.empty((count, 2))
    x = np.zeros(STATES) if start is None else start.copy()
    load = Load(np.array([0.1, 0.3, 0.2]), np.linspace(0, 1.9, 2 * count - 1))
    march(p, SCALES.as_tuple(), x, voltage, w, load, PERIOD, is_free, out, shaft)
    return out, shaft


UNSET_LOOP = np.where(np.arange(STATES) == 10, UNSET, 0.0)


@pytest.mark.parametrize("start", [np.zeros(STATES), UNSET_LOOP], ids=["at rest", "loop unset"])
@pytest.mark.parametrize("extra", [SPOKEN, {}], ids=["all", "four"])
@pytest.mark.parametrize("is_free", [False, True])
def test_derivatives_of_all_numbers_at_once_are_those_of_differences(is_free, extra, start):
    """With all that may be added, and with nothing: a number that is zero moves states that nothing else moves."""
    count, p = 400, numbers(extra)
    voltage, w = forcing(count)
    load = Load(np.array([0.1, 0.3, 0.2]), np.linspace(0, 1.9, 2 * count - 1))
    exact, none_x = np.empty((COUNT, count, 3)), np.zeros((COUNT, STATES))
    along = Directions(np.eye(COUNT), none_x, np.arange(COUNT))
    tangents(p, SCALES.as_tuple(), start, along, voltage, w, load, PERIOD, is_free, exact)
    for k, name in enumerate(NAMES):
        step = 1e-5 * max(abs(p[k]), 0.05 if name not in DEFAULTS else p[k])
        up, down = p.copy(), p.copy()
        up[k] += step
        down[k] -= step
        runs = [run(moved, count, is_free=is_free, start=start)[0] for moved in (up, down)]
        differences = (runs[0] - runs[1]) / (2 * step)
        assert np.abs(differences - exact[k]).max() <= 2e-5 * max(np.abs(exact[k]).max(), 1.0), name


@pytest.mark.parametrize("is_free", [False, True])
def test_derivatives_by_the_first_state_are_those_of_differences(is_free):
    """Of every state beside all that may be added."""
    count, p, exact = 300, numbers(SPOKEN), np.empty((STATES, 300, 3))
    start = np.array([0.3, -0.9, 0.2, -0.8, 2.0, 1.0, 0.1, 0.2, 290.0, 0.4, 20.0])
    load = Load(np.array([0.1, 0.3, 0.2]), np.linspace(0, 1.9, 2 * count - 1))
    along = Directions(np.zeros((STATES, COUNT)), np.eye(STATES), np.arange(STATES))
    tangents(p, SCALES.as_tuple(), start, along, *forcing(count), load, PERIOD, is_free, exact)
    for found, direction in zip(exact, np.eye(STATES), strict=True):
        step = 1e-5 * max(start @ direction, 1.0) * direction
        up, down = (run(p, count, is_free=is_free, start=start + sign * step)[0] for sign in (1.0, -1.0))
        assert np.abs((up - down) / (2 * step.sum()) - found).max() <= 2e-5 * max(np.abs(found).max(), 1e-3)


COUNT_LOADED = 40
LOAD = Load(np.array([0.1, 0.3, 0.2, 0.4]), np.linspace(0, 2.9, 2 * COUNT_LOADED - 1))
"""Four knots over as many samples."""


def complex_marches():
    """(4, 100, 3): derivatives of the currents by each knot, from marches of complex numbers that are moved along it by 1e-30 i."""
    count, whole = COUNT_LOADED, []
    p, x = numbers(SPOKEN) + 0j, np.zeros(STATES, dtype=complex)
    for direction in np.eye(4):
        out, shaft = np.empty((count, 3), dtype=complex), np.empty((count, 2), dtype=complex)
        moved = Load(LOAD.knots + 1e-30j * direction, LOAD.places)
        march(p, SCALES.as_tuple(), x.copy(), *forcing(count), moved, PERIOD, True, out, shaft)
        whole.append(out.imag / 1e-30)
    return np.array(whole)


@pytest.fixture(scope="module")
def exact(tmp_path_factory):
    """In a process that compiles nothing: compiled, complex numbers take 20 s."""
    file = tmp_path_factory.mktemp("marches") / "complex.npy"
    subprocess.run(
        [sys.executable, "-m", __name__, str(file)], env=os.environ | {"NUMBA_DISABLE_JIT": "1"}, check=True, cwd=ROOT
    )
    return np.load(file)


@pytest.mark.parametrize("many", [4, 3])
def test_derivatives_along_the_loads_knots_are_those_of_complex_marches(exact, many):
    """Everything else in the machine spoken for; asked for all of them or for the first three."""
    found = np.empty((many, COUNT_LOADED, 3))
    none = Directions(np.zeros((0, COUNT)), np.zeros((0, STATES)), np.arange(many))
    tangents(
        numbers(SPOKEN), SCALES.as_tuple(), np.zeros(STATES), none, *forcing(COUNT_LOADED), LOAD, PERIOD, True, found
    )
    for one, whole in zip(found, exact, strict=False):
        assert np.abs(whole).max() > 0.0
        assert np.abs(one - whole).max() <= 1e-11 * np.abs(whole).max()


def test_steady_current_is_that_of_the_circuit():
    """I = U / (R_s + j w L_sigma + j w L_M parallel R_R / s): closed form at constant speed."""
    p, count = numbers({}), 6000
    t = 0.5 * PERIOD * np.arange(2 * count - 1)
    voltage = 326.6 * np.stack([np.cos(314.16 * t), np.sin(314.16 * t)], axis=1)
    w = np.stack([np.full(t.size, 300.0), np.zeros(t.size)], axis=1)
    out, shaft = np.empty((count, 3)), np.empty((count, 2))
    march(
        p,
        SCALES.as_tuple(),
        np.zeros(STATES),
        voltage,
        w,
        Load(np.zeros(2), np.zeros(t.size)),
        PERIOD,
        False,
        out,
        shaft,
    )
    slip = 1.0 - 300.0 / 314.16
    rotor = p[1] / slip
    impedance = p[0] + 314.16j * p[2] + 314.16j * p[3] * rotor / (314.16j * p[3] + rotor)
    current = (out[-1, 0] + 1j * out[-1, 1]) * np.exp(-1j * 314.16 * t[-1])
    assert abs(current - 326.6 / impedance) < 2e-4 * abs(current)
    rotor_current = abs(326.6 / impedance * 314.16j * p[3] / (314.16j * p[3] + rotor))
    assert shaft[-1, 1] == pytest.approx(1.5 * rotor * rotor_current**2 / (314.16 / 2), rel=1e-3)


def test_a_start_is_that_of_the_simulator_with_another_circuit():
    """The simulator's Gamma machine in rotor coordinates, started; the same voltages and speed give its currents to a thousandth
    of the noise a good sensor has."""
    from commissioner.estimation.record import between
    from sim.motoring.hidden import draw
    from sim.motoring.play import play
    from sim.motoring.recording import answer_key

    scenario = draw(3, "null")
    played = play(scenario)
    truth = answer_key(scenario, played, 3)["inverse_gamma"]
    every = played.substeps
    first = int(np.argmax(np.abs(played.voltage[::every]) > 0)) + 1
    u, i, w = (x[::every][first : first + 3000] for x in (played.voltage, played.current, played.speed_rad_per_s))
    pairs = scenario.machine.pole_pairs
    p = numbers({})
    p[:4] = list(truth.values())
    psi_s = np.zeros(STATES)
    # the flux after the first samples: integral of the voltage less the drop, on the fine grid
    fine = slice((first - 1) * every, first * every + 1)
    step = played.time_s[1]
    emf = (played.voltage - truth["stator_resistance_ohm"] * played.current)[: first * every + 1]
    flux = np.sum(0.5 * step * (emf[1:] + emf[:-1]))
    psi_s[0], psi_s[1] = flux.real, flux.imag
    leak = truth["leakage_inductance_h"] * i[0]
    psi_s[2], psi_s[3] = (flux - leak).real, (flux - leak).imag
    assert fine.stop <= played.voltage.size
    scales = Scales(11.7, 326.6, 314.16, 26.0, pairs)
    out, shaft = np.empty((u.size, 3)), np.empty((u.size, 2))
    speed = np.stack([between(w * pairs), np.zeros(2 * u.size - 1)], axis=1)
    voltage = np.stack([between(u.real), between(u.imag)], axis=1)
    march(
        p,
        scales.as_tuple(),
        psi_s,
        voltage,
        speed,
        Load(np.zeros(2), np.zeros(2 * u.size - 1)),
        PERIOD,
        False,
        out,
        shaft,
    )
    error = np.hypot(out[5:, 0] - i[5:].real, out[5:, 1] - i[5:].imag)
    assert np.sqrt(np.mean(error**2)) < 5e-4 * np.abs(i).max()


def test_saturation_of_the_air_gaps_flux_is_that_of_the_t_circuit():
    """Fluxes of both windings, one magnetizing branch that saturates: the node is solved by bisection."""
    stator, rotor, main, extra, count = 0.0054, 0.0066, 0.17, 0.3, 300
    g = main / (main + rotor)
    p = numbers({"gap_saturation_1": extra * g, "leakage_split": stator / (g * rotor)})
    p[:4] = [1.32, 1.02, stator + g * rotor, g * main]
    voltage, speed = forcing(count)
    u = voltage[:, 0] + 1j * voltage[:, 1]
    rated = SCALES.voltage_v / SCALES.frequency_rad_per_s

    def currents(psi):
        whole = psi[0] / stator + psi[1] / rotor
        low, high = 0.0, 1.0
        for _ in range(60):
            share = 0.5 * (low + high)
            flux = share * whole / (1.0 / stator + 1.0 / rotor)
            taken = flux * (1.0 / stator + 1.0 / rotor + (1.0 + extra * abs(flux / rated) ** 2) / main)
            low, high = (share, high) if abs(taken) < abs(whole) else (low, share)
        return (psi[0] - flux) / stator, (psi[1] - flux) / rotor

    def slope(psi, m):
        i, i_r = currents(psi)
        return np.array([u[m] - p[0] * i, -p[1] / g**2 * i_r + 1j * speed[m, 0] * psi[1]])

    psi, expected = np.zeros(2, complex), []
    for q in range(count):
        expected.append(currents(psi)[0] if abs(psi[0]) else 0.0)
        if q < count - 1:
            a = slope(psi, 2 * q) if q else np.array([u[0], 0.0])
            b = slope(psi + 0.5 * PERIOD * a, 2 * q + 1)
            c = slope(psi + 0.5 * PERIOD * b, 2 * q + 1)
            d = slope(psi + PERIOD * c, 2 * q + 2)
            psi = psi + PERIOD / 6.0 * (a + 2.0 * (b + c) + d)
    found = run(p, count, is_free=False)[0]
    assert np.abs(found[:, 0] + 1j * found[:, 1] - expected).max() < 1e-4 * np.abs(expected).max()


@pytest.mark.parametrize(
    ("extra", "turns"),
    [({"load_ripple_cos_2": 0.03}, 2.0), ({"load_swing_cos": 0.03, "load_swing_turns": 1.618}, 1.618)],
)
def test_a_load_that_ripples_drives_no_shaft_at_rest_and_swings_one_that_turns(extra, turns):
    """Without voltage. At rest none of its torque moves the shaft; turning with W, a cos(k theta) of it swings the speed by a T / (k J W)."""
    p, count, x = numbers({"load_ripple_cos": 0.06, "inertia": 0.1} | extra), 500, np.zeros(STATES)
    t = 0.5 * PERIOD * np.arange(2 * count - 1)
    none, load = np.zeros((t.size, 2)), Load(np.zeros(2), np.zeros(t.size))
    out, shaft = np.empty((count, 3)), np.empty((count, 2))
    march(p, SCALES.as_tuple(), x.copy(), none, none, load, PERIOD, True, out, shaft)
    assert np.abs(shaft[:, 0]).max() == 0.0
    x[8], p[AT["load_ripple_cos"]] = 300.0, 0.0
    march(p, SCALES.as_tuple(), x, none, none, load, PERIOD, True, out, shaft)
    swing = -0.03 * 26.0 / 0.1 / (turns * 150.0) * np.sin(turns * 150.0 * t[::2])
    assert (shaft[:, 0] - 300.0) / 2 == pytest.approx(swing, abs=0.02 * np.abs(swing).max())


def test_a_fan_brakes_a_shaft_that_turns_either_way():
    """Without voltage the shaft slows down by 1 / (1 + t / tau), tau = J w_n^2 / (pole pairs T w_0), as long as no flux is left."""
    p, count = numbers({"load_fan": 1.0, "inertia": 0.1}), 500
    t = 0.5 * PERIOD * np.arange(2 * count - 1)
    none, out, shaft = np.zeros((t.size, 2)), np.empty((count, 3)), np.empty((count, 2))
    slowed = 300.0 / (1.0 + t[::2] * 2 * 26.0 * 300.0 / (0.1 * 314.16**2))
    for way in (1.0, -1.0):
        x = np.zeros(STATES)
        x[8] = way * 300.0
        march(p, SCALES.as_tuple(), x, none, none, Load(np.zeros(2), np.zeros(t.size)), PERIOD, True, out, shaft)
        assert way * shaft[:, 0] == pytest.approx(slowed, rel=1e-6)


if __name__ == "__main__":
    np.save(sys.argv[1], complex_marches())


@pytest.mark.parametrize("iron", [0.0, 0.02])
def test_what_shorted_turns_take_makes_no_drop_in_the_winding(iron):
    """Shorted turns lie in the winding: its resistance and its magnetomotive force see (i_k - mu i_f). With a drop, L_M of a motor with
    them was 0.6 to 1.6 % off, 22 to 35 of its standard deviations."""
    loop, count = {"loop_conductance_v": 0.03, "loop_susceptance_v": 0.01}, 1500
    bare, bare_shaft = run(numbers({"iron_conductance": iron}), count, is_free=True)
    with_it, shaft = run(numbers({"iron_conductance": iron, **loop}), count, is_free=True)
    assert np.array_equal(shaft, bare_shaft)
    more = (with_it - bare)[:, :2]
    along, across = np.array([-0.5, np.sqrt(0.75)]), np.array([np.sqrt(0.75), 0.5])
    assert np.abs(more @ across).max() < 1e-9
    volts = forcing(count)[0][::2] @ along
    after = count // 2
    taken = np.linalg.lstsq(
        np.stack([volts, np.gradient(volts, PERIOD)], axis=1)[after:-1], (more @ along)[after:-1], rcond=None
    )[0]
    assert taken[0] == pytest.approx(0.03 * SCALES.current_a / SCALES.voltage_v, rel=0.02)


@pytest.mark.parametrize(("start", "settled"), [(UNSET, 0), (0.0, 250)])
def test_a_shorted_loop_is_a_resistance_and_a_leakage_at_every_harmonic(start, settled):
    """As a conductance and a susceptance it took 2.5 times too much of a fifth harmonic: a start of a 2.2 kW motor with 3 % of shorted turns under 3 % of
    fifth and 5 % of seventh had a delay of 27.00 +- 0.29 us beside the right name."""
    g, b, count, w = 0.03, 0.024, 500, SCALES.frequency_rad_per_s
    first = np.zeros(STATES)
    first[:4] = [0.0, -1.04, 0.0, -1.04]  # the flux of the voltage
    first[10] = start
    loop = {"loop_conductance_u": g, "loop_susceptance_u": b}
    plain, faulty = (run(numbers(n), count, is_free=False, start=first)[0] for n in ({}, loop))
    t, x = PERIOD * np.arange(count), b / g
    told = sum(
        326.6 * size * np.real(g * (1 + x * x) / (1 + 1j * order * x) * np.exp(1j * order * w * t))
        for order, size in ((1, 1.0), (5, 0.01))
    )
    taken = (faulty - plain) * SCALES.voltage_v / SCALES.current_a
    late = slice(settled, None)
    assert np.abs(taken[late, 1]).max() < 1e-9
    assert np.abs(taken[late, 0] - told[late]).max() < (0.02 if settled else 0.2)
    assert np.abs(taken[250:, 0] - told[250:]).max() < 0.02
    assert 326.6 * 0.01 * g * (1 - (1 + x * x) / abs(1 + 5j * x)) > 0.04  # which a conductance is off by
