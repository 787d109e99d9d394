"""The extended model goes through its file unchanged, and the simulated inverter's translation of it behaves alike."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.export.model_file import model_document, model_from, plain
from commissioner.diagnose.export.playback import PAUSE_S, play
from commissioner.diagnose.plant.model import Model
from sim.recordings.standstill import record
from sim.scenario import build, load
from tests.unit.diagnose.conftest import NOMINAL, PLATE

TONES = [[14.0, 2.3, 0.4], [20.0, 41.9, 1.0], [30.0, 331.7, 2.0]]
SHARE = NOMINAL[2] / (NOMINAL[2] + NOMINAL[3])
VALUES = {
    "dead_time": {"leg_5": 0.5, "leg_6": 0.8, "leg_7": 0.5},
    "dc_link_sag": {"sag_10ms": 0.05},
    "sampling_delay": {"delay": 60e-6},
    "sensor_lag": {"lag": 50e-6, "shape": 0.25},
    "magnetizing_saturation": {f"curve_{k}": 0.01 for k in range(1, 11)},
    "magnetic_hysteresis": {"loop_0": 0.004, "loop_1": 0.01, "loop_2": 0.01},
    "leakage_saturation": {f"curve_{k}": 0.2 for k in range(8)},
    "rotor_skin_effect": {"branch_1": 0.03, "branch_2": 0.03},
    "iron_loss": {"conductance": 1e-3},
    "stator_heating": {"own": 1.5},
    "rotor_heating": {"rotor_heat": 4.0},
    "sensor_offset": {"u": 0.03, "v": -0.02, "w": 0.01},
    "sensor_drift": {"u": 0.4, "v": -0.2, "w": 0.1},
    "sensor_switch_on": {"switch_on_30ms_u": 0.3, "switch_on_30ms_w": -0.2},
    "sensor_gain_mismatch": {"v": 0.01, "w": -0.02},
    "sensor_nonlinearity": {f"{p}_{k}": 0.01 for p in ("odd", "even") for k in "uvw"},
    "clock_drift": {"drift": 40.0},
    "inductance_anisotropy": {
        "leakage_cos": 0.03 * (1.0 - SHARE),
        "leakage_sin": -0.02 * (1.0 - SHARE),
        "magnetizing_cos": -0.03 * SHARE,
        "magnetizing_sin": 0.02 * SHARE,
        "split": 0.5,
    },  # a leakage that lies on the rotor's side, as in the Gamma circuit
    "resistance_anisotropy": {"stator_cos": 0.02, "stator_sin": 0.03},
    "cable_capacitance": {"at": 3e-8},
}
EQUAL = {
    "sensor_switch_on",
    "sensor_drift",
    "sensor_offset",
    "sampling_delay",
    "iron_loss",
    "clock_drift",
    "sensor_lag",
    "resistance_anisotropy",
    "inductance_anisotropy",
}
"""Effects that both sides parameterise alike; the others are matched at one operating point."""
EXACT = {"sampling_delay", "sensor_lag", "sensor_offset", "iron_loss", "inductance_anisotropy"}
"""Of these, those that both sides also solve alike."""


def found(name, setting, numbers=None):
    terms = CATALOGUE[name].terms(setting)
    numbers = numbers or VALUES[name]
    values = tuple(numbers.get(t.symbol, 0.0) for t in terms)
    model = Model(NOMINAL, terms, values)
    sizes = {k: (v, 0.0, u) for k, (v, u) in CATALOGUE[name].sizes(setting, model.of(name)).items()}
    cause = SimpleNamespace(name=name, sizes=sizes)
    return SimpleNamespace(
        fit=SimpleNamespace(model=model), layout=setting.layout, setting=setting, record=setting.record
    ), [cause]


def document_of(name, setting):
    return json.loads(json.dumps(model_document(*found(name, setting))))


def simulated(document):
    """Columns the simulated inverter records of the document's scenario on three axes."""
    segments = [
        {"axis_deg": a, "duration_s": 1.2, "zero_s": 0.1, "ramp_s": 0.1, "tones": TONES} for a in (0.0, 60.0, 120.0)
    ]
    return record(build({**document["scenario"], "recording": {"segments": segments, "pause_s": PAUSE_S}}), 1)[0]


def commands(columns):
    return [(a, columns["voltage_axis_v"][columns["segment"] == k]) for k, a in enumerate((0.0, 60.0, 120.0))]


def played(document, setting, columns):
    model, layout = model_from(document)
    out = play(model, layout, setting.facts, commands(columns), setting.lines_hz)
    return np.stack([out[f"current_{p}_a"] for p in "uvw"])


@pytest.mark.parametrize("name", sorted(VALUES))
def test_the_file_keeps_the_model_and_the_simulator_translates_it(name, setting):
    document = document_of(name, setting)
    assert model_from(document)[0].of(name) == {
        k: v for k, v in found(name, setting)[0].fit.model.of(name).items() if v
    }
    columns = simulated(document)
    theirs = np.stack([columns[f"current_{p}_a"] for p in "uvw"])
    ours, nominal = played(document, setting, columns), played(plain(document), setting, columns)
    effect = np.sqrt(np.mean((ours - nominal) ** 2))
    assert effect > 1e-4 * np.abs(nominal).max()
    assert np.sqrt(np.mean((theirs - ours) ** 2)) < (0.01 if name in EXACT else 0.1 if name in EQUAL else 0.55) * effect


def test_a_clock_that_runs_on_does_so_on_both_sides(setting):
    document = json.loads(json.dumps(model_document(*found("clock_drift", setting, {"running": 15.0}))))
    columns = simulated(document)
    theirs = np.stack([columns[f"current_{p}_a"] for p in "uvw"])
    ours, nominal = played(document, setting, columns), played(plain(document), setting, columns)
    last = slice(2 * theirs.shape[1] // 3, None)
    effect = np.sqrt(np.mean((ours - nominal)[:, last] ** 2))
    assert effect > 4.0 * np.sqrt(np.mean((ours - nominal)[:, : theirs.shape[1] // 3] ** 2))
    assert np.sqrt(np.mean((theirs - ours)[:, last] ** 2)) < 0.1 * effect


def test_the_model_without_effects_is_the_plain_motor_on_both_sides(setting):
    document = document_of("iron_loss", setting)
    document["scenario"]["effects"] = {}
    columns = simulated(document)
    ours = played(plain(document), setting, columns)
    theirs = np.stack([columns[f"current_{p}_a"] for p in "uvw"])
    assert np.abs(ours - theirs).max() < 1e-4 * np.abs(theirs).max()


def test_the_simulated_inverter_reads_the_model_file(setting, tmp_path):
    path = tmp_path / "model.json"
    path.write_text(json.dumps(document_of("dead_time", setting)))
    plant = load(str(path)).plant
    assert [e.name for e in plant.effects] == ["dead_time"]
    assert plant.nameplate.rated_power_w == PLATE["rated_power_w"]


def test_a_file_that_is_no_extended_model_is_refused():
    for broken in ({}, {"kind": "extended_model", "format": 99}, {"kind": "scenario", "format": 1}):
        with pytest.raises(ValueError, match="extended model"):
            model_from(broken)


@pytest.mark.parametrize("name", ["dc_link_ripple", "mains_pickup", "shaft_motion"])
def test_a_model_plays_alike_on_shorter_segments(name, setting):
    """They have fewer knots of a speed, so that every channel behind those lies elsewhere."""
    terms = CATALOGUE[name].terms(setting)
    numbers = {t.symbol: 0.3 if name == "shaft_motion" else 0.05 for t in terms if t.segment == 0 and t.channel}
    document = json.loads(json.dumps(model_document(*found(name, setting, numbers))))
    columns = simulated(document_of("iron_loss", setting))
    cut = {k: v[columns["segment"] == 0][:2500] for k, v in columns.items()}
    (model, layout), long = model_from(document), commands(columns)
    short = play(model, layout, setting.facts, [(0.0, cut["voltage_axis_v"])], setting.lines_hz)
    whole = play(model, layout, setting.facts, long, setting.lines_hz)
    plain_model, _ = model_from(plain(document))
    without = play(plain_model, None, setting.facts, [(0.0, cut["voltage_axis_v"])], setting.lines_hz)
    effect = short["current_v_a"] - without["current_v_a"]
    assert np.abs(effect).max() > 1e-3
    same = slice(0, 1250)  # of a speed, before the knots of the shorter segment lie elsewhere
    assert np.abs(short["current_v_a"] - whole["current_v_a"][:2500])[same].max() < 0.02 * np.abs(effect).max()


def test_numbers_that_no_motor_has_are_refused(setting):
    good = document_of("iron_loss", setting)
    term = good["terms"][0]
    for change, said in (
        ({"nominal": good["nominal"] | {"stator_resistance_ohm": -3.0}}, "above zero"),
        ({"terms": [term | {"value": float("nan")}]}, "finite"),
        ({"terms": [term | {"kind": 77}]}, "kind 77"),
        ({"dictionary": {}}, "dictionary"),
    ):
        with pytest.raises(ValueError, match=said):
            model_from(good | change)
