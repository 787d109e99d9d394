"""A cause is one file: outside the catalogue nothing writes a cause's name."""

import ast
from pathlib import Path

import pytest

from commissioner.diagnose.causes import CATALOGUE, CONFOUNDED, _once, confounders_of
from commissioner.diagnose.causes.cause import Confounder
from commissioner.running.causes import CATALOGUE as RUNNING

ROOT = Path(__file__).parents[2] / "commissioner"


def literals(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {n.value for n in ast.walk(tree) if isinstance(n, ast.Constant) and isinstance(n.value, str)}


def test_no_cause_is_named_outside_the_catalogue():
    rooms = {ROOT / "diagnose/causes", ROOT / "running/causes"}
    files = [p for p in ROOT.rglob("*.py") if not rooms & set(p.parents)]
    names = {*CATALOGUE, *RUNNING}
    assert not [(p.relative_to(ROOT).as_posix(), word) for p in files for word in literals(p) if word in names]


def test_the_rooms_of_the_catalogue_name_none_either():
    shared = list((ROOT / "diagnose/causes").glob("*.py"))
    assert len(shared) > 5 and not [(p.name, word) for p in shared for word in literals(p) if word in CATALOGUE]


def test_places_are_given_once_and_files_are_called_as_their_cause():
    assert [c.place for c in CATALOGUE.values()] == list(range(len(CATALOGUE)))
    assert all(type(c).__module__.rpartition(".")[2] == name for name, c in CATALOGUE.items())


def test_a_pair_is_known_both_ways_and_stated_once():
    assert all(a in confounders_of(b) and b in confounders_of(a) for a, b in map(tuple, CONFOUNDED))
    known = {"sensor_offset", "sensor_drift", "sensor_switch_on", "magnetic_hysteresis", "shaft_motion"}
    assert confounders_of("remanence") == known
    pair = frozenset({"a", "b"}), Confounder("b")
    assert _once([pair]) and set().union(*CONFOUNDED) <= set(CATALOGUE)
    with pytest.raises(ValueError, match="a and b"):
        _once([pair, pair])
