"""`diagnose`, `identify` and `simulate` on a recorded start: recognised, answered, written out, played again."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from commissioner.operations.recordings.diagnose import DiagnoseRequest, diagnose
from commissioner.operations.recordings.identify import IdentifiedRunning, IdentifyRequest, identify_any
from commissioner.operations.recordings.simulate import SimulateRequest, simulate
from commissioner.recordings.table import read_table
from sim.__main__ import main as simulator
from sim.motoring.recording import build, record
from sim.recordings.standstill import write_table
from tests.support.service.described import judge
from tests.unit.cli.test_failures import leave

SCENARIO = Path(__file__).parents[3] / "sim" / "scenarios" / "start_turn_fault.toml"


@pytest.fixture(scope="module")
def start(tmp_path_factory):
    path = tmp_path_factory.mktemp("running") / "start.csv"
    columns, metadata, truth = record(build(tomllib.loads(SCENARIO.read_text("utf-8"))), 4)
    write_table(path, columns, metadata)
    return path, truth


@pytest.fixture(scope="module")
def diagnosed(start):
    return diagnose(DiagnoseRequest((start[0],), out=start[0].parent / "out"))


def test_a_start_with_a_turn_fault_is_diagnosed_as_such(diagnosed):
    document = json.loads(json.dumps(diagnosed.document))
    judge("diagnose", document)
    assert document["verdict"] == "explained"
    assert [c["name"] for c in document["causes"]] == ["stator_asymmetry"]
    assert "current_in_v_of_rated" in document["causes"][0]["parameters"]
    assert document["gain"]["held_out"] > 0.95
    assert document["test"] == "running"
    for key in (
        "causes",
        "gain",
        "parameters_before",
        "parameters_after",
        "next_experiment",
        "model_file",
        "audit",
        "detection_limits",
    ):
        assert key in document
    page = (diagnosed.out / "report.html").read_text("utf-8")
    assert page.count("<figure>") == 3
    assert "Phase v of the stator takes" in page


def test_the_extended_model_plays_what_was_measured_and_is_a_scenario(start, diagnosed):
    path, _ = start
    model = diagnosed.out / "model.json"
    judge("model", json.loads(model.read_text("utf-8")))
    errors = {}
    for is_plain in (False, True):
        out = path.parent / f"played_{is_plain}.csv"
        done = simulate(SimulateRequest(str(model), out, like=path, plain=is_plain))
        assert done.effects == (() if is_plain else ("stator_asymmetry",))
        measured, played = read_table(path).columns, read_table(out).columns
        count = 5000
        errors[is_plain] = np.std(measured["current_v_a"][-count:] - played["current_v_a"][-count:])
    assert errors[False] < 0.05  # the noise is 0.02 A; what began at rest has forgotten how
    assert errors[True] > 2.0 * errors[False]
    assert simulator(["--scenario", str(model), "--recording", str(path.parent / "again.csv")]) == 0
    again = read_table(path.parent / "again.csv")
    assert again.columns["time_s"].size == 15000
    assert simulate(SimulateRequest(str(model), path.parent / "ideal.csv")).samples == 15000


def test_the_start_is_identified(start, tmp_path):
    path, truth = start
    found = identify_any(IdentifyRequest((path,), out=tmp_path / "out"))
    assert isinstance(found, IdentifiedRunning)
    judge("identify", found.document)
    for key, true in truth["inverse_gamma"].items():
        assert found.document["parameters"][key]["value"] == pytest.approx(true, rel=0.05)
    assert found.document["inertia_kg_m2"]["value"] == pytest.approx(truth["inertia_kg_m2"], rel=0.02)
    assert any("diagnose" in remark for remark in found.document["remarks"])
    page = (tmp_path / "out" / "report.html").read_text("utf-8")
    assert "Measured against simulated" in page and "data:image/png" in page
    assert json.loads((tmp_path / "out" / "identification.json").read_text("utf-8")) == found.document


def test_kinds_are_not_mixed(start, capsys, tmp_path):
    other = tmp_path / "standstill.csv"
    other.write_text(
        "time_s,segment,axis_deg,voltage_axis_v,current_u_a,current_v_a\n0,0,0,1,1,1\n0.1,0,0,1,1,1\n", "utf-8"
    )
    code, document = leave(capsys, "diagnose", str(start[0]), str(other))
    assert code == 3
    assert "one kind" in document["error"]["limit"]


def test_a_recording_without_current_is_refused_in_a_sentence(start, tmp_path, capsys):
    columns, metadata, _ = record(build(tomllib.loads(SCENARIO.read_text("utf-8"))), 4)
    for phase in "uvw":
        columns[f"voltage_{phase}_v"] = 0.0 * columns[f"voltage_{phase}_v"]
    write_table(tmp_path / "off.csv", columns, metadata)
    code, document = leave(capsys, "diagnose", str(tmp_path / "off.csv"))
    assert code == 3
    assert document["verdict"] == "refused"
    assert document["error"]["remedy"]
