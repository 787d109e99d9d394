"""Every entry of the catalogue: zero is nominal, small is linear, sensitivities are exact, signs and units are kept."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.plant.model import Model
from commissioner.diagnose.plant.prediction import predict
from tests.unit.diagnose.conftest import central_slope, currents

NAMES = [
    "dead_time",
    "device_drop",
    "dc_link_sag",
    "dc_link_ripple",
    "sampling_delay",
    "sensor_lag",
    "magnetizing_saturation",
    "magnetic_hysteresis",
    "remanence",
    "leakage_saturation",
    "rotor_skin_effect",
    "iron_loss",
    "stator_heating",
    "rotor_heating",
    "sensor_offset",
    "sensor_drift",
    "sensor_gain_mismatch",
    "sensor_nonlinearity",
    "quantization",
    "clipping",
    "mains_pickup",
    "clock_drift",
    "lost_samples",
    "shaft_motion",
    "inductance_anisotropy",
    "resistance_anisotropy",
    "cable_capacitance",
    "sensor_switch_on",
]
FITTED = [n for n in NAMES if n not in ("device_drop", "quantization", "lost_samples")]


def extended(nominal, setting, name, theta):
    """The nominal model with every number of the effect at `theta` steps."""
    terms = CATALOGUE[name].terms(setting)
    model = nominal.with_terms(terms)
    return Model(model.nominal, model.terms, tuple(theta * t.step for t in terms))


def test_the_catalogue_has_the_27_names_of_the_contract_and_one_more():
    assert sorted(CATALOGUE) == sorted(NAMES) and len(NAMES) == 28


@pytest.mark.parametrize("name", NAMES)
def test_every_entry_states_signature_source_confounders_and_what_would_split_it(name):
    entry = CATALOGUE[name]
    assert len(entry.signature) > 20 and entry.source and entry.split_by and entry.__doc__
    assert {c.name for c in entry.confounders} | set(entry.imitates) <= set(NAMES) - {name}


@pytest.mark.parametrize("name", FITTED)
def test_zero_is_the_nominal_model(name, nominal, setting):
    plain = currents(nominal, setting)
    with_zero = currents(extended(nominal, setting, name, 0.0), setting)
    assert np.abs(with_zero - plain).max() < 2e-6 * np.abs(plain).max()


@pytest.mark.parametrize("name", FITTED)
def test_it_grows_continuously_and_first_in_proportion(name, nominal, setting):
    segment = 0 if name == "sensor_switch_on" else 1  # what settles as a file begins is gone in its second segment
    base = currents(extended(nominal, setting, name, 1e-9), setting, segment)
    small = currents(extended(nominal, setting, name, 0.01), setting, segment) - base
    double = currents(extended(nominal, setting, name, 0.02), setting, segment) - base
    size = np.sqrt(np.mean(small**2))
    assert size > 0
    assert np.sqrt(np.mean((double - 2.0 * small) ** 2)) < 0.05 * size


@pytest.mark.parametrize("name", FITTED)
def test_the_sensitivities_are_those_of_the_simulation(name, nominal, setting):
    terms = CATALOGUE[name].terms(setting)
    k = next((k for k, t in enumerate(terms) if t.segment in (-1, setting.record.segments[1].uid)), 0)
    model = nominal.with_terms(terms)
    jacobian = predict(model, setting.record, 1, setting.layout, wanted=terms).jacobian[4 + k]
    h = 1e-3
    moved = [
        currents(Model(model.nominal, terms, tuple(s * t.step * (j == k) for j, t in enumerate(terms))), setting)
        for s in (1e-9, h, 2.0 * h)
    ]
    slope = (4.0 * (moved[1] - moved[0]) - (moved[2] - moved[0])) / (2.0 * h)
    size = np.sqrt(np.mean(slope**2))
    assert size > 0
    assert np.sqrt(np.mean((jacobian - slope) ** 2)) < 0.02 * size


@pytest.mark.parametrize("name", [n for n in FITTED if CATALOGUE[n].sign > 0])
def test_the_sign_of_the_size_is_the_sign_of_the_numbers(name, setting):
    entry = CATALOGUE[name]
    terms = entry.terms(setting)
    up = entry.sizes(setting, {t.symbol: t.step for t in terms})
    value, unit = next(iter(up.values()))
    assert value > 0 and unit


def size(name, setting, **values):
    return CATALOGUE[name].sizes(setting, values)


def with_value(nominal, setting, name, symbol, value):
    terms = CATALOGUE[name].terms(setting)
    return Model(nominal.nominal, terms, tuple(value * (t.symbol == symbol) for t in terms))


def test_an_offset_of_ten_milliampere_adds_ten_milliampere_to_one_phase(nominal, setting):
    change = currents(with_value(nominal, setting, "sensor_offset", "v", 0.01), setting) - currents(nominal, setting)
    assert change[1] == pytest.approx(0.01, abs=1e-9) and np.abs(change[[0, 2]]).max() < 1e-9


def test_a_gain_of_one_percent_scales_one_phase(nominal, setting):
    plain = currents(nominal, setting)
    change = currents(with_value(nominal, setting, "sensor_gain_mismatch", "w", 0.01), setting) - plain
    assert change[2] == pytest.approx(0.01 * plain[2], abs=1e-9) and np.abs(change[:2]).max() < 1e-9


def test_a_delay_of_one_period_is_the_sample_before(nominal, setting):
    late = currents(with_value(nominal, setting, "sampling_delay", "delay", 2e-4), setting)
    plain = currents(nominal, setting)
    assert np.abs(late[:, 1000:] - plain[:, 999:-1]).max() < 1e-4 * np.abs(plain).max()
    assert size("sampling_delay", setting, delay=2e-4)["delay_us"] == (pytest.approx(200.0), "us")


def test_a_lag_turns_a_tone_by_its_arcus_tangent(nominal, setting):
    lag = 1e-4
    late, plain = currents(with_value(nominal, setting, "sensor_lag", "lag", lag), setting), currents(nominal, setting)
    at = np.exp(-2j * np.pi * 41.9 * np.arange(late.shape[1]) * 2e-4) * np.hanning(late.shape[1])
    ratio = (late[0] @ at) / (plain[0] @ at)
    assert ratio == pytest.approx(1.0 / (1.0 + 2j * np.pi * 41.9 * lag), abs=1e-3)


def test_stator_heating_of_a_tenth_per_minute_raises_the_resistance_by_a_tenth_per_minute_of_rated_current(
    nominal, setting
):
    """The end of the last segment, against a plain motor whose resistance is higher by the dose reached there."""
    model = with_value(nominal, setting, "stator_heating", "mean", 0.1)
    dose = setting.record.channels[2][-1, setting.record.channel("heat_mean_u")]
    r_s, *others = nominal.nominal
    plain = currents(nominal, setting, segment=2)
    warmer = currents(Model((r_s * (1.0 + 0.1 * dose), *others)), setting, segment=2)
    heated = currents(model, setting, segment=2)
    asked, made = (warmer - plain)[:, -1500:], (heated - plain)[:, -1500:]
    assert float((asked * made).sum() / (asked * asked).sum()) == pytest.approx(0.95, abs=0.07)


def test_the_leg_loss_reads_as_dead_time_in_microseconds(setting):
    values = {t.symbol: 2.0 / setting.layout.legs_vectors.shape[0] for t in CATALOGUE["dead_time"].terms(setting)}
    sizes = size("dead_time", setting, **values)
    volts = sizes["voltage_v"][0]
    assert volts > 0
    assert sizes["time_us"] == (pytest.approx(volts / (5000.0 * 540.0) * 1e6), "us")


def test_a_bar_that_shares_the_current_reads_as_the_rise_of_the_rotor_resistance(nominal, setting):
    """One branch g / (1 + s T) beside 1 / R_R: Re of the parallel impedance at 50 Hz, over that at rest."""
    terms = CATALOGUE["rotor_skin_effect"].terms(setting)
    g, corner = 0.1, 1.0 / setting.layout.branch_time_s[2] / (2.0 * np.pi)
    rise, unit = size("rotor_skin_effect", setting, branch_2=g)["resistance_rise_at_rated_frequency"]
    r = nominal.nominal[1]
    parallel = 1.0 / (1.0 / r + g / (1.0 + 50.0j / corner))
    assert rise == pytest.approx(parallel.real * (1.0 / r + g) - 1.0, rel=1e-9) and unit == "1"
    assert {t.symbol for t in terms} >= {"branch_2"} and 0.0 < rise < r * g


def test_effects_the_data_cannot_show_have_no_numbers(nominal):
    from tests.unit.diagnose.conftest import setting_of

    single = setting_of(nominal, axes=(0.0,))
    assert CATALOGUE["inductance_anisotropy"].terms(single) == ()
    assert CATALOGUE["resistance_anisotropy"].terms(single) == ()
    assert CATALOGUE["device_drop"].terms(single) == ()


def test_one_axis_has_no_shares_of_the_legs(nominal, setting):
    """Along it v = w = 1.08 of the mean made a leg that gives voltage, and standard errors of 1e-8."""
    from tests.unit.diagnose.conftest import setting_of

    def kinds_of(one):
        return {t.kind for t in CATALOGUE["dead_time"].terms(one)}

    assert kinds_of(setting) - kinds_of(setting_of(nominal, axes=(0.0, 180.0))) == {kinds.LEG_SHARE}


@pytest.mark.parametrize("symbol", ["loop_0", "loop_6", "loop_9", "loop_11", "split", "R_s", "L_M"])
def test_sensitivities_beside_loops_that_widen_with_flux_are_exact(nominal, setting, symbol):
    """Derivatives pass through the memory of every operator and through the factor that grows with flux."""
    terms = CATALOGUE["magnetic_hysteresis"].terms(setting)
    values = tuple(0.1 if t.symbol == "split" else 0.02 for t in terms)
    model = Model(nominal.nominal, terms, values)
    row = {"R_s": 0, "L_M": 3}.get(symbol) or (0 if symbol == "R_s" else 4 + [t.symbol for t in terms].index(symbol))
    jacobian = predict(model, setting.record, 1, setting.layout, wanted=terms).jacobian[row]
    slope = central_slope(model, setting, row, 1e-4)
    assert np.sqrt(np.mean((jacobian - slope) ** 2)) < 0.02 * np.sqrt(np.mean(slope**2))


@pytest.mark.parametrize("symbol", ["conductance", "eddy_10", "eddy_12", "branch_2"])
def test_sensitivities_beside_eddy_paths_are_exact(nominal, setting, symbol):
    """Eddy paths carry current at the terminals and lose voltage in R_s; beside them a rotor branch stays one."""
    terms = CATALOGUE["iron_loss"].terms(setting) + CATALOGUE["rotor_skin_effect"].terms(setting)
    held = {"conductance": 2e-4, "eddy_10": 3e-4, "eddy_12": 5e-4, "branch_2": 0.02}
    model = Model(nominal.nominal, terms, tuple(held.get(t.symbol, 0.0) for t in terms))
    row = 4 + [t.symbol for t in terms].index(symbol)
    jacobian = predict(model, setting.record, 1, setting.layout, wanted=terms).jacobian[row]
    slope = central_slope(model, setting, row, 1e-3)
    assert np.sqrt(np.mean((jacobian - slope) ** 2)) < 0.01 * np.sqrt(np.mean(slope**2))


def test_second_paths_much_faster_than_the_sampling_can_be_asked_for_beside_a_dead_time(nominal, setting):
    """Their voltages would run away in Runge-Kutta steps of a period: 16 us against 200 us."""
    legs = CATALOGUE["dead_time"].terms(setting)
    model = Model(nominal.nominal, legs, tuple(0.1 for _ in legs))
    asked = CATALOGUE["rotor_skin_effect"].terms(setting)
    fast = replace(setting.layout, branch_time_s=setting.layout.branch_time_s / 10.0)
    jacobian = predict(model, setting.record, 1, fast, wanted=asked).jacobian
    assert np.isfinite(jacobian).all() and np.abs(jacobian[4:]).max() < 100.0 * np.abs(jacobian[:4]).max()


def test_bars_that_carry_most_of_the_current_stay_stable_where_loops_are_asked_for(nominal, setting):
    """Paths of 11 times the conductance and 0.2 ms make a mode of 12 periods' rate: steps for 0.2 ms alone let it grow."""
    bars, loops = CATALOGUE["rotor_skin_effect"].terms(setting), CATALOGUE["magnetic_hysteresis"].terms(setting)
    r_s, r_r, l_sigma, l_m = nominal.nominal
    fast = min(
        (t for t in bars), key=lambda t: abs(setting.layout.branch_time_s[t.index] - setting.facts.sample_period_s)
    )
    model = Model((r_s, 20.0 * r_r, l_sigma, l_m), bars, tuple(11.0 / (20.0 * r_r) if t is fast else 0.0 for t in bars))
    jacobian = predict(model, setting.record, 0, setting.layout, wanted=(*bars, *loops)).jacobian
    assert np.isfinite(jacobian).all() and np.abs(jacobian).max() < 1e6


INSIDE = [
    "dead_time", "dc_link_sag", "dc_link_ripple", "magnetizing_saturation", "magnetic_hysteresis", "remanence", "leakage_saturation",
    "rotor_skin_effect", "iron_loss", "stator_heating", "rotor_heating", "shaft_motion", "inductance_anisotropy",
    "resistance_anisotropy",
]  # fmt: skip


@pytest.fixture(scope="module")
def crowded(nominal, setting):
    """A machine with every effect inside it at once, small, and its derivatives in the second segment."""
    own = setting.record.segments[1].uid
    terms = tuple(t for name in INSIDE for t in CATALOGUE[name].terms(setting) if t.segment in (-1, own))
    strong, none = {"rotor_skin_effect": 10.0}, [t.effect == "iron_loss" and t.symbol != "conductance" for t in terms]
    values = tuple(
        (0.02 + 0.01 * (k % 3)) * t.step * strong.get(t.effect, 1.0) * (not left_out)
        for k, (t, left_out) in enumerate(zip(terms, none, strict=True))
    )
    model = Model(nominal.nominal, terms, values)
    return model, predict(model, setting.record, 1, setting.layout, wanted=terms).jacobian


@pytest.mark.parametrize("name", ["", *INSIDE])
def test_sensitivities_beside_every_other_effect_are_exact(crowded, setting, name):
    """No effect's push may go where only another's belongs: a turning shaft is no voltage that feeds the bars' branches."""
    model, jacobian = crowded
    rows = [4 + k for k, t in enumerate(model.terms) if t.effect == name] if name else range(4)
    for row in {*list(rows)[:6], *list(rows)[-2:]}:
        slope = central_slope(model, setting, row, 1e-3)
        size = np.sqrt(np.mean(slope**2))
        about = model.terms[row - 4].symbol if row > 3 else row
        assert np.sqrt(np.mean((jacobian[row] - slope) ** 2)) <= 0.02 * size, (about, size)


@pytest.mark.parametrize(("shape", "delay"), [(0.0, None), (0.25, 100.0 * (1.0 - 0.5**0.5)), (0.5, 100.0)])
def test_of_a_lag_what_may_be_a_delay_is_said(setting, shape, delay):
    """exp(-s D) / (1 + s T) has the second order of 1 / (1 + s S + s^2 q S^2) where D + T = S and T^2 = (1 - 2 q) S^2."""
    sizes = CATALOGUE["sensor_lag"].sizes(setting, {"lag": 1e-4, "shape": shape})
    assert sizes["time_constant_us"][0] == pytest.approx(100.0)
    assert ("may_be_delay_us" not in sizes) if delay is None else sizes["may_be_delay_us"][0] == pytest.approx(delay)
