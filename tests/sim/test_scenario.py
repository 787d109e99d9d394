"""Scenario files are strict: what cannot be is one sentence and exit code 2."""

from __future__ import annotations

import subprocess
import sys

import pytest

from sim.scenario import ScenarioError, build, load, names, read_document
from sim.truth import answer_key


@pytest.mark.parametrize("name", [n for n in names() if read_document(n).get("kind") != "running"])
def test_every_scenario_has_an_answer_key(name):
    truth = answer_key(load(name), 1)
    at_rated, unsaturated = (truth["inverse_gamma"][k] for k in ("at_rated_flux", "unsaturated"))
    assert 0.0 < at_rated["magnetizing_inductance_h"] <= unsaturated["magnetizing_inductance_h"]


def test_default_is_the_published_motor():
    at_rated = answer_key(load("default"))["inverse_gamma"]["at_rated_flux"]
    assert at_rated["stator_resistance_ohm"] == 3.7
    assert at_rated["rotor_resistance_ohm"] == pytest.approx(2.09, abs=0.005)
    assert at_rated["leakage_inductance_h"] == pytest.approx(21.0e-3, abs=0.05e-3)
    assert at_rated["magnetizing_inductance_h"] == pytest.approx(0.224, abs=0.001)


@pytest.mark.parametrize(
    ("document", "words"),
    [
        ({"machin": {}}, "unknown key machin"),
        ({"machine": {"stator_resistance": 3.0}}, "unknown key machine.stator_resistance"),
        ({"machine": {"stator_resistance_ohm": -3.0}}, "machine.stator_resistance_ohm = -3.0 must be above 0"),
        ({"machine": {"stator_resistance_ohm": "3"}}, "must be a finite number"),
        ({"machine": {"saturation_shape": "cubic"}}, "must be one of power"),
        ({"machine": {"id": "nobody"}}, "not in the machine table"),
        ({"sensors": {"gain": [1.0, 1.0]}}, "list of 3 numbers"),
        ({"effects": {"gremlins": 1.0}}, "unknown key effects.gremlins"),
        ({"effects": {"dead_time": {"size": 1.0, "shape": "square"}}}, "effects.dead_time.shape"),
        ({"effects": {"dead_time": {"shape": "tanh"}}}, "needs size in V"),
        ({"recording": {"segments": [{"duration_s": 0.0}]}}, "duration_s"),
        ({"drive": {"watchdog": 1}}, "unknown key drive.watchdog"),
        ({"drive": {"parameters": {"stator_resistance_ohm": 1.0}}}, "drive.parameters needs"),
        ({"kind": "flying"}, "must be 'standstill' or 'running'"),
        ({"noise": {"kind": "pink"}}, "noise.kind"),
    ],
)
def test_a_bad_scenario_is_named_in_one_sentence(document, words):
    with pytest.raises(ScenarioError) as error:
        build(document, "bad.toml")
    assert words in str(error.value)
    assert str(error.value).startswith("bad.toml")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "arguments",
    [
        ["--scenario", "nobody"],
        ["--scenario", "BAD"],
        ["--tcp", "0", "--speed", "fast"],
        ["--tcp", "0", "--fault", "gremlin"],
        [],
        ["--tls", "0"],
    ],
)
def test_command_line_refuses_with_exit_code_two(arguments, tmp_path):
    bad = tmp_path / "bad.toml"
    bad.write_text("[machine]\nresistance = 3\n")
    arguments = [str(bad) if a == "BAD" else a for a in arguments]
    result = subprocess.run(
        [sys.executable, "-m", "sim", *arguments], capture_output=True, text=True, timeout=60, check=False
    )
    assert result.returncode == 2
    assert result.stderr.startswith("sim: ")
    assert result.stderr.count("\n") == 1


def test_a_scenario_may_build_on_another(tmp_path):
    child = tmp_path / "child.toml"
    child.write_text('extends = "default"\n[machine]\nstator_resistance_ohm = 4.1\n')
    machine = load(str(child)).plant.machine
    assert (machine.stator_resistance_ohm, machine.rotor_resistance_ohm) == (4.1, 2.5)
    child.write_text(f'extends = "{child}"\n')
    with pytest.raises(ScenarioError, match="circles"):
        load(str(child))
