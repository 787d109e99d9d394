"""A [tune] table is taken whole or refused by name: a remote form only with every fact sourced, and its steps in a safe order."""

import copy
import tomllib

import pytest

from commissioner.errors import ConfigurationError
from commissioner.link.files.drive_file import DRIVES_FOLDER, build, known_drives, load_profile
from commissioner.registers.profile import is_a_lead

ATV340 = tomllib.loads((DRIVES_FOLDER / "schneider_atv340.toml").read_text("utf-8"))


def changed(change):
    document = copy.deepcopy(ATV340)
    change(document["tune"])
    return document


def without_read_back(tune):
    tune["step"] = [s for s in tune["step"] if not (s["do"] == "expect" and s["item"] == "tune_kind")]


def start_twice(tune):
    tune["step"].append(next(s for s in tune["step"] if s.get("once")))


def rotating(tune):
    next(s for s in tune["step"] if s["do"] == "write" and s["item"] == "tune_kind")["value"] = 3


@pytest.mark.parametrize(
    ("change", "key"),
    [
        (lambda t: t["facts"].pop("stop"), "tune.facts.stop"),
        (lambda t: t["facts"].pop("standstill"), "tune.facts.standstill"),
        (lambda t: t["facts"]["failed"].update(source="lead"), "tune.facts.failed.source"),
        (lambda t: t["facts"]["start"].update(source=""), "tune.facts.start.source"),
        (lambda t: t["facts"]["finished"].update(source="unknown"), "tune.facts.finished.source"),
        (lambda t: t.update(source=" "), "tune.source"),
        (without_read_back, "tune.step"),
        (start_twice, "tune.step"),
        (rotating, "tune.step"),
        (lambda t: t["step"][-1].update(failed={}), "tune.step"),
        (lambda t: t["step"][-1].update(busy=[]), "tune.step"),
        (lambda t: t.update({"finally": []}), "tune.finally"),
        (lambda t: t["finally"].pop(), "tune.finally"),
        (lambda t: t["step"][0].update(item="nothing"), "tune.step[0].item"),
        (lambda t: t.update(results=["pole_pairs", "nothing"]), "tune.results"),
        (lambda t: t.update(form="assisted"), "tune.step[3].do"),
        (lambda t: t.update(kind="rotating"), "tune.kind"),
    ],
)
def test_a_remote_tuning_that_is_not_safe_is_refused_by_name(change, key):
    with pytest.raises(ConfigurationError) as refused:
        build(changed(change), "x.toml")
    assert refused.value.key == key


def test_no_shipped_file_has_a_lead_for_an_address_or_an_unproved_conversion():
    for name in known_drives():
        profile = load_profile(name)
        if profile.kind != "commercial":
            continue
        assert not [item.name for item in profile.items.values() if is_a_lead(item.source) or not item.source]
        converted = [n for n in (profile.parameters.order if profile.parameters else ()) if profile.item(n).convention]
        proved = {w.item for w in profile.worked if w.per_phase is not None}
        assert set(converted) <= proved, name


def test_every_shipped_file_says_on_what_its_tuning_was_proved_or_why_there_is_none():
    for name in known_drives():
        profile = load_profile(name)
        if profile.kind == "commercial":
            assert (profile.tuning is None) == ("tune" in profile.unknown), name
            assert profile.tuning is None or profile.tuning.proof == "proved on no physical drive yet"
