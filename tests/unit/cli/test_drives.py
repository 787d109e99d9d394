"""`drives list | show | validate`: what works is told before anything is connected; a file with an error is refused by name."""

import pytest

from commissioner.cli.app import app
from commissioner.link.files.drive_file import DRIVES_FOLDER, known_drives
from tests.unit.cli.test_failures import leave


def test_show_says_what_works_and_on_what_it_was_proved(capsys):
    code, shown = leave(capsys, "drives", "show", "schneider_atv340")
    assert code == 0
    works = {row["verb"]: row for row in shown["works"]}
    assert works["check"]["works"] and works["restore"]["works"] and works["tune"]["works"]
    assert "proved on no physical drive yet" in works["tune"]["how"]
    assert not works["run: the whole procedure at standstill"]["works"]


def test_show_says_what_to_do_instead_where_a_verb_does_not_work(capsys):
    _, shown = leave(capsys, "drives", "show", "siemens_v20")
    works = {row["verb"]: row for row in shown["works"]}
    assert not works["tune"]["works"] and "keypad" in works["tune"]["how"]


def test_list_names_every_file_with_what_it_can(capsys):
    code, rows = leave(capsys, "drives", "list")
    assert code == 0 and {row["name"] for row in rows} == set(known_drives())
    assert {row["name"]: row["tune"] for row in rows}["danfoss_fc302"] == "assisted"


@pytest.mark.parametrize("name", ["danfoss_fc302", "weg_cfw700"])
def test_validate_carries_the_worked_examples_out(capsys, name):
    code, done = leave(capsys, "drives", "validate", str(DRIVES_FOLDER / f"{name}.toml"))
    assert (code, done["outcome"]) == (0, "valid")
    assert f"{done['worked_examples']} worked examples" in done["reason"]


def test_validate_boasts_of_no_example_where_there_is_none(capsys):
    code, done = leave(capsys, "drives", "validate", str(DRIVES_FOLDER / "simulated.toml"))
    assert (code, done["outcome"], done["worked_examples"]) == (0, "valid", 0)
    assert "worked" not in done["reason"]


def test_validate_names_key_value_and_what_would_be_right(capsys, tmp_path):
    text = (DRIVES_FOLDER / "danfoss_fc302.toml").read_text("utf-8").replace("words = [0, 37020]", "words = [0, 37021]")
    file = tmp_path / "wrong.toml"
    file.write_text(text, "utf-8")
    code, failed = leave(capsys, "drives", "validate", str(file))
    assert code == 2
    assert "worked[0].value" in failed["error"]["what"] and "3.7021" in failed["error"]["limit"]


def test_the_screens_for_people_are_words_and_tables(capsys):
    app(["drives", "list"], standalone_mode=False)
    app(["drives", "show", "yaskawa_a1000"], standalone_mode=False)
    app(["drives", "validate", str(DRIVES_FOLDER / "yaskawa_a1000.toml")], standalone_mode=False)
    said = capsys.readouterr().out
    assert "tune (assisted)" in said and "worked examples" in said
