"""What a rule chose is told from a journal alone, and a rule that no choice asks is not called idle."""

import json

from commissioner.diagnose.rules import RULES
from commissioner.diagnose.search.journal import Accepted, Began, Beside, Screened, Tried, replayed, written
from tests.campaigns.ablation import asked, changed, main

STEPS = (
    Began((), 1000),
    Screened({"dead_time": (500.0, 4), "sensor_offset": (70.0, 3)}, Beside({}, 0.0, 1000.0, 0.0)),
    Tried("dead_time", 500.0, 4, 480.0, 80.0, "the price of its numbers"),
    Accepted("dead_time", 1.0),
    Screened({"sensor_offset": (70.0, 3)}, Beside({"dead_time": 480.0}, 0.0, 1000.0, 0.0)),
    Tried("sensor_offset", 70.0, 3, 60.0, 70.0, "the price of its numbers"),
)


def test_what_a_rule_chose_is_told_without_a_fit():
    assert replayed(STEPS).differs == ()
    assert any("sensor_offset accepted" in choice for choice in changed(STEPS, "floor_chi2", 0.0))
    assert changed(STEPS, "tie_chi2", 0.0) == ()


def test_the_command_prints_what_was_asked_and_names_the_rest(tmp_path, capsys):
    assert {"floor_chi2", "number_chi2"} <= asked(STEPS) and "tie_chi2" not in asked(STEPS)
    path = tmp_path / "diagnosis.json"
    path.write_text(json.dumps({"search": written(STEPS)}), "utf-8")
    main([str(path)])
    table, _, rest = capsys.readouterr().out.partition("not asked by these journals:")
    assert f"floor_chi2 {RULES.floor_chi2:24.4g}".split() == table.split()[:2]
    assert "tie_chi2" in rest and "floor_chi2" not in rest
