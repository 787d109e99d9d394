"""Recordings and hidden cases: the contract's table, deterministic, every effect visible and continuous."""

from __future__ import annotations

import copy
import gzip
import json
import subprocess
import sys

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy.linalg import expm

from sim.physics.effects import CATALOGUE
from sim.physics.inductance import inverse_gamma
from sim.recordings import hidden
from sim.recordings.standstill import record, write_table
from sim.scenario import build, load

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
SHORT = {
    "axis_deg": 20.0,
    "duration_s": 0.8,
    "ramp_s": 0.1,
    "bias_v": 4.0,
    "tones": [[12.0, 2.3, 0.2], [10.0, 41.9, 1.0]],
}


def short_document() -> dict:
    document = copy.deepcopy(hidden.draw(4, "null").document)
    document["nameplate"], document["machine"] = {}, {"saturation_at_rated_flux": 0.0, "inductance_h": 0.25}
    document["noise"] = {"kind": "white"}
    document["sensors"]["noise_a"] = 1e-3
    document["sensors"]["full_scale_a"] = 15.0
    document["recording"] = {"segments": [SHORT, SHORT], "pause_s": 0.5}
    return document


def play(document: dict, seed: int = 1) -> dict:
    return record(build(document), seed)[0]


def test_catalogue_has_the_agreed_names():
    assert sorted(CATALOGUE) == sorted(NAMES)


def test_table_has_the_contract_columns_on_a_grid():
    columns, metadata, truth = record(load("poor"), 1)
    assert list(columns) == [
        "time_s",
        "segment",
        "axis_deg",
        "voltage_axis_v",
        "current_u_a",
        "current_v_a",
        "current_w_a",
        "dc_link_v",
    ]
    assert metadata["sample_period_s"] == 2e-4
    assert np.allclose(np.diff(columns["time_s"]), 2e-4)
    assert truth["segments"][0]["stator_flux_wb"] > 0.05


def test_same_seed_same_bits_and_another_seed_other_noise():
    document = short_document()
    once, again, other = play(document), play(document), play(document, 2)
    for name in once:
        np.testing.assert_array_equal(once[name], again[name])
    assert np.std(once["current_u_a"] - other["current_u_a"]) == pytest.approx(1e-3 * np.sqrt(2.0), rel=0.05)


@pytest.mark.parametrize("name", NAMES)
def test_every_shape_of_every_effect_shows_and_vanishes_with_its_size(name):
    plain = short_document()
    plain["recording"]["segments"] = [{**SHORT, "duration_s": 0.4, "bias_v": 14.0}]
    reference = play(plain)["current_u_a"]
    for shape in CATALOGUE[name].shapes:
        change = []
        for size in (CATALOGUE[name].largest, 1e-3 * CATALOGUE[name].largest):
            document = copy.deepcopy(plain)
            document["effects"] = {name: {"size": size, "shape": shape}}
            current = play(document)["current_u_a"]
            n = min(current.size, reference.size)
            change.append(float(np.sqrt(np.mean((current[:n] - reference[:n]) ** 2))))
        assert change[0] > 0.0
        assert change[1] <= 0.05 * change[0], (name, shape, change)


@pytest.mark.parametrize("stratum", hidden.STRATA)
def test_strata_draw_what_they_say(stratum):
    scenario = hidden.draw(11, stratum)
    causes = {"null": 0, "absent": 0, "one": 1, "two": 2, "three": 3, "four": 4, "tie": 1}.get(stratum)
    if causes is not None:
        assert len(scenario.plant.effects) == causes
    assert hidden.draw(11, stratum).document == scenario.document
    assert hidden.draw(12, stratum).document != scenario.document
    assert bool(scenario.document.get("unlisted")) == (stratum == "absent")


def test_answer_key_names_sizes_and_motor():
    _, metadata, truth = hidden.case(3, "two", "poor")
    assert len(truth["effects"]) == 2
    assert all(entry["size"] and entry["unit"] for entry in truth["effects"])
    assert truth["inverse_gamma"]["at_rated_flux"]["magnetizing_inductance_h"] > 0.0
    assert "scenario" not in metadata


def test_hidden_motors_stay_below_their_rated_flux_without_bias():
    for seed in range(4):
        _, _, truth = hidden.case(seed, "null", "poor")
        assert truth["segments"][0]["stator_flux_wb"] < truth["rated_flux_wb"]


@pytest.mark.parametrize("late", [0.0, 0.1, 0.5, 0.95, 1.0, 1.3])
def test_a_loss_resistance_draws_its_new_current_as_soon_as_the_voltage_steps(late):
    document = short_document()
    document["sensors"] |= {"delay_s": late * 2e-4, "noise_a": 1e-4}
    document["effects"] = {"iron_loss": {"size": 0.02, "shape": "resistor"}}
    document["recording"] = {"segments": [{**SHORT, "tones": [[12.0, 83.0, 0.2], [30.0, 330.0, 1.0]]}], "pause_s": 0.5}
    plant = build(document).plant
    columns = play(document)
    u, g, r = columns["voltage_axis_v"], 0.02, plant.machine.stator_resistance_ohm
    per_leak, per_ls = 1.0 / plant.machine.leakage_inductance_h, 1.0 / 0.25
    core = np.array([per_ls + per_leak, -per_leak])  # current of (psi_s, psi_r) beside the resistance
    share = 1.0 / (1.0 + r * g)
    rate = np.array([-r * share * core, plant.machine.rotor_resistance_ohm * np.array([per_leak, -per_leak])])
    whole = np.block([[rate, np.array([[share], [0.0]])], [np.zeros((1, 3))]])
    back = int(late) + 1  # at an edge: what was there before the step
    step, part = expm(whole * 2e-4), expm(whole * 2e-4 * (back - late))
    flux, exact = np.zeros((u.size + 1, 2)), np.zeros(u.size)
    for k, v in enumerate(u):
        flux[k + 1] = step[:2, :2] @ flux[k] + step[:2, 2] * v
    for k in range(back, u.size):
        held = u[k - back]
        exact[k] = share * (core @ (part[:2, :2] @ flux[k - back] + part[:2, 2] * held) + g * held)
    axis = np.radians(SHORT["axis_deg"])
    along = (
        sum(
            columns[f"current_{name}_a"] * np.cos(axis - k * 2.0 * np.pi / 3.0)
            for name, k in (("u", 0), ("v", 1), ("w", -1))
        )
        * 2.0
        / 3.0
    )
    assert np.std(g * np.diff(u)) > 0.1
    np.testing.assert_allclose(along[3:], exact[3:], atol=6e-4)


def test_lost_rows_leave_no_hole_in_time_but_are_missing():
    document = short_document()
    document["effects"] = {"lost_samples": {"size": 3, "shape": "whole_rows"}}
    columns = play(document)
    assert columns["time_s"].size == 2 * (4000 - 3)
    assert np.allclose(np.diff(columns["time_s"][:3997]), 2e-4)


def test_files_carry_columns_and_keys(tmp_path):
    columns, metadata, _ = record(load("poor"), 1)
    write_table(tmp_path / "r.csv.gz", columns, metadata)
    write_table(tmp_path / "r.parquet", columns, metadata)
    lines = gzip.decompress((tmp_path / "r.csv.gz").read_bytes()).decode().splitlines()
    header = next(line for line in lines if not line.startswith("#"))
    assert header == ",".join(columns)
    assert "# rated_voltage_v: 400.0" in lines
    table = pq.read_table(tmp_path / "r.parquet")
    assert table.schema.metadata[b"pole_pairs"] == b"2"
    np.testing.assert_array_equal(table["current_v_a"], columns["current_v_a"])


def test_command_line_writes_the_recording_and_prints_the_key(tmp_path):
    out = tmp_path / "r.csv"
    command = [sys.executable, "-m", "sim", "--scenario", "poor", "--recording", str(out), "--truth", "--seed", "2"]
    truth = json.loads(subprocess.run(command, capture_output=True, check=True, text=True).stdout)
    expected = inverse_gamma(load("poor").plant, truth["rated_flux_wb"])
    assert truth["inverse_gamma"]["at_rated_flux"] == pytest.approx(expected)
    assert out.read_text().count("\n") == 40000 + 13
