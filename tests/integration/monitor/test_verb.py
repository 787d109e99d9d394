"""`commissioner monitor` from a file to its exit code, JSON, waveforms, report and trend."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from commissioner.recordings.table import write_table
from sim.recordings.running import load_scenario, record
from tests.support.command_line import call
from tests.support.service.described import judge

DATA = Path(__file__).parents[2] / "data"
COLUMNS = ["time_s", "shaft_angle_rad", "speed_rad_per_s", "electromagnetic_torque_nm", "load_torque_nm"]


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Four healthy compressors and a leaking one, 12 s each, with a reference speed in the first."""
    folder = tmp_path_factory.mktemp("running")
    paths = {}
    for name, scenario, seed in [
        ("healthy", "running_compressor", 1),
        ("second", "running_compressor", 2),
        ("third", "running_compressor", 3),
        ("fourth", "running_compressor", 4),
        ("leak", "running_leak", 5),
    ]:
        document = load_scenario(scenario)
        document["recording"]["duration_s"] = 12.0
        document["sensing"]["reference_speed"] = name == "healthy"
        if name == "leak":
            document["loads"][0]["leak_mm2"] = [3.1, 0.0]
        columns, metadata, truth = record(document, seed)
        paths[name] = folder / f"{name}.parquet"
        write_table(paths[name], columns, metadata)
        (folder / f"{name}.json").write_text(json.dumps(truth, default=float))
    return paths


def command(*arguments: str) -> tuple[int, str, str]:
    done = call("monitor", *arguments, timeout_s=240.0)
    return done.code, done.stdout, done.stderr


def test_json_waveforms_and_report(recordings: dict[str, Path], tmp_path: Path) -> None:
    code, out, _ = command(str(recordings["healthy"]), "--out", str(tmp_path / "result"), "--json")
    assert code == 0
    document = json.loads(out)
    judge("monitor", document)
    truth = json.loads(recordings["healthy"].with_suffix(".json").read_text())
    assert document["mean_speed_rad_per_s"]["value"] == pytest.approx(truth["mean_speed_rad_per_s"], rel=2e-4)
    assert document["refused_because"] is None
    assert set(document["parameters"]) == {
        "stator_resistance_ohm",
        "rotor_resistance_ohm",
        "leakage_inductance_h",
        "magnetizing_inductance_h",
        "rotor_time_constant_s",
    }
    assert all(q["std"] > 0 for q in document["parameters"].values())
    assert document["current_resimulation_error"]["relative_rms"] < 0.05
    assert document["periods"][0]["name"] == "shaft"
    assert document["indicators"]["pulses_per_turn"] == 2
    assert abs(document["reference_speed"]["mean_speed_relative_error"]) < 2e-4
    assert document["reference_speed"]["ripple_relative_error"] < 0.05
    rows = list(csv.DictReader((tmp_path / "result" / "characteristic_period.csv").read_text().splitlines()))
    assert list(rows[0])[:5] == COLUMNS
    angle = np.array([float(row["shaft_angle_rad"]) for row in rows])
    assert angle[-1] == pytest.approx(2 * np.pi, rel=0.01) and np.all(np.diff(angle) > 0)
    page = (tmp_path / "result" / "report.html").read_text()
    assert page.count("<figure>") >= 5
    for outside in ("http://", "https://", "<script", 'src="/'):
        assert outside not in page.replace("http://www.w3.org", "").replace("http://purl.org", "").replace(
            "http://creativecommons.org", ""
        ).replace("https://matplotlib.org", "")


def test_baseline_learns_judges_and_alarms(recordings: dict[str, Path], tmp_path: Path) -> None:
    baseline = str(tmp_path / "machine.json")
    states = []
    for name, *more in (("healthy",), ("second", "--learn"), ("third", "--learn"), ("fourth",), ("leak",)):
        code, out, _ = command(str(recordings[name]), "--baseline", baseline, "--json", *more)
        assert code == 0
        states.append(json.loads(out)["trend"]["state"])
    assert states[0] == "stored"
    assert states[3:] == ["normal", "alarm"]


def test_human_view_is_short_and_names_what_was_not_fixed(recordings: dict[str, Path]) -> None:
    code, out, _ = command(str(recordings["healthy"]))
    assert code == 0
    assert "mean speed" in out and "Least known" in out
    assert len(out.splitlines()) < 40


def test_a_recording_that_cannot_carry_an_answer_exits_3_with_the_reason() -> None:
    plate = DATA / "lias_mcsadc_excerpt" / "ccs1_first_100ms.csv"
    code, out, _ = command(str(plate), "--motor", "motor_2kw2", "--json")
    assert code == 3
    document = json.loads(out)
    judge("monitor", document)
    assert document["refused_because"]["code"] == "too_short"
    assert document["mean_torque_nm"] is None
    assert document["indicators"]["power_w"] == pytest.approx(1203, abs=3)


def test_a_single_current_is_refused_with_what_is_missing() -> None:
    code, _, err = command(str(DATA / "acs712_motor" / "healthy_motor_data.csv"), "--motor", "motor_2kw2")
    assert code == 3
    assert "three voltages" in err


def test_a_missing_plate_is_a_usage_error(tmp_path: Path) -> None:
    path = tmp_path / "bare.csv"
    time = np.arange(100) * 1e-3
    names = ("current_u_a", "current_v_a", "current_w_a", "voltage_u_v", "voltage_v_v", "voltage_w_v")
    write_table(path, {"time_s": time} | {name: np.cos(time) for name in names}, {})
    code, _, err = command(str(path))
    assert code == 2
    assert "rated_power_w" in err


def test_a_commissioning_result_is_the_start(recordings: dict[str, Path], tmp_path: Path) -> None:
    result = tmp_path / "result.json"
    values = {
        "stator_resistance_ohm": 3.5,
        "rotor_resistance_ohm": 1.9,
        "leakage_inductance_h": 0.02,
        "magnetizing_inductance_h": 0.22,
    }
    result.write_text(json.dumps({"parameters": {name: {"value": v, "std": 0.01 * v} for name, v in values.items()}}))
    code, out, _ = command(str(recordings["second"]), "--start", str(result), "--json")
    assert code == 0
    document = json.loads(out)
    judge("monitor", document)
    assert document["parameters_from"].startswith("commissioning result")
    assert document["parameters"]["rotor_resistance_ohm"]["value"] == pytest.approx(2.09, rel=0.03)
