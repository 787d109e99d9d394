"""`diagnose --why`: every record of the search as a row, and that it decides the same again."""

from commissioner.cli.screens import search as screen
from commissioner.diagnose.search.journal import Accepted, Beside, Dropped, Said, Screened, Tried, written

STEPS = (
    Said("noise 10 mA rms, from zero voltage"),
    Screened({"sensor_offset": (7e4, 3)}, Beside({}, 6e4, 4e4, 20.0)),
    Tried("sensor_offset", 7e4, 3, 7.1e4, 70.0, "the price of its numbers"),
    Accepted("sensor_offset", 1.003),
    Dropped("sensor_offset", 7e4, 70.0, "the price of its numbers", is_sound=True, is_taken=False),
)


def test_every_step_is_shown_with_what_it_gained_and_wanted(capsys):
    screen.show({"search": written(STEPS)})
    shown = " ".join(capsys.readouterr().out.split())
    assert "accepted" in shown and "7.1e+04" in shown and "the price of its numbers" in shown
    assert "stays" in shown and "the same choices" in shown


def test_a_choice_that_its_numbers_do_not_bear_out_is_said(capsys):
    doctored = tuple(s for s in STEPS if not isinstance(s, Accepted))
    screen.show({"search": written(doctored)})
    assert "sensor offset accepted in place of nothing" in " ".join(capsys.readouterr().out.split())


def test_test_points_have_no_search(capsys):
    screen.show({"kind": "points"})
    assert capsys.readouterr().out == ""
