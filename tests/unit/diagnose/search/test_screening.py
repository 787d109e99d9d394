"""What a promise may count on: numbers on a bound imitate nothing, several effects promise what they promise together."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.intake.record import Record
from commissioner.diagnose.plant.prediction import predict
from commissioner.diagnose.rules import RULES
from commissioner.diagnose.search.acceptance import guard
from commissioner.diagnose.search.journal import Beside, RuledOut, Screened, Tried, chosen, ruled_out
from commissioner.diagnose.search.screening import joint_net, screen
from commissioner.diagnose.search.state import Problem, begun, material_chi2

WHITE = Noise(np.full(3, 0.01), np.array([1.0, 1000.0]), np.ones((3, 2)), "given", True, 0.0, True)


@pytest.fixture(scope="module")
def late(setting, nominal):
    """The conftest machine, its currents 40 us late."""
    terms = CATALOGUE["sampling_delay"].terms(setting)
    model = replace(nominal.with_terms(terms), values=(4e-5, 0.0))
    record = setting.record
    segments = tuple(
        replace(s, currents_a=predict(model, record, k, setting.layout).currents_a)
        for k, s in enumerate(record.segments)
    )
    return Record(segments, record.facts, record.channel_names, record.channels)


def promised(model, record, setting, names):
    return screen(model, record, setting.layout, WHITE, replace(setting, record=record), names)


def test_rotor_paths_at_zero_do_not_hide_a_delay(late, setting, nominal):
    alone = promised(nominal, late, setting, ["sampling_delay"]).scores["sampling_delay"].delta_chi2
    beside = nominal.with_terms(CATALOGUE["rotor_skin_effect"].terms(setting))
    assert not beside.is_free[4:].any()
    assert promised(beside, late, setting, ["sampling_delay"]).scores["sampling_delay"].delta_chi2 == pytest.approx(
        alone, rel=1e-6
    )
    moved = replace(beside, values=tuple(0.01 for _ in beside.values))
    assert moved.is_free.all()


def test_a_group_promises_at_least_what_each_of_it_does(late, setting, nominal):
    screening = promised(nominal, late, setting, ["sampling_delay", "iron_loss", "cable_capacitance"])
    delay = screening.scores["sampling_delay"]
    assert joint_net(screening, ["sampling_delay"]) == pytest.approx(delay.net, rel=1e-6)
    both = joint_net(screening, ["sampling_delay", "cable_capacitance"])
    assert both + 30.0 >= delay.net * (1.0 - 1e-9)


def test_a_cause_that_takes_nearly_all_of_a_large_rest_is_no_part_of_anothers_form():
    losses, samples = {"shaft_motion": 1e8}, 1e6
    large, small = 0.05 * samples, 0.005 * samples
    asked = [
        Beside(losses, rest, samples, 0.0).guard("inductance_anisotropy", RULES)[0] for rest in (large, small, 1e9)
    ]
    own = guard(losses, "inductance_anisotropy")
    assert asked == pytest.approx([RULES.entirely_share * large, own, own])


def test_what_samples_left_out_might_hold_is_not_asked_for(setting, nominal):
    def asked(record):
        state = begun(replace(setting, record=record), record, None)
        return state.samples, material_chi2(state, Problem(WHITE, ()))

    record = setting.record
    half = tuple(replace(s, is_good=np.arange(s.count) % 2 == 0) for s in record.segments)
    whole, left_out = asked(record), asked(replace(record, segments=half))
    assert left_out == pytest.approx([0.5 * x for x in whole], rel=1e-3)


def test_beside_what_a_cause_that_was_ruled_out_would_take_a_weak_one_is_not_named():
    """A sag of a link that stands still takes ten times what any other does: it is real, and six weak causes are not its name."""
    promised = {"dc_link_sag": (2e5, 6), "iron_loss": (2e3, 4)}

    def seen(kept, rest=0.0, losses=()):
        return Screened(promised, Beside(dict(losses), rest, 1e6, 10.0), (), kept)

    weak = [Tried("iron_loss", 2e3, 4, 2e3, 80.0, "")]
    out = [Tried("dc_link_sag", 2e5, 6, 1e5, 100.0, "", is_sound=False, kept=0.5)]
    assert ruled_out(seen({}), weak) == RuledOut() and chosen(seen({}), weak) == "iron_loss"
    for screened, tried in ((seen({"dc_link_sag": 0.5}), weak), (seen({}), [*out, *weak])):
        assert ruled_out(screened, tried) == RuledOut("dc_link_sag", 1e5) and chosen(screened, tried) is None
    hidden = seen({"dc_link_sag": 0.5}, losses={"dead_time": 1e10}.items())
    assert ruled_out(hidden, weak) == RuledOut()
    assert [chosen(seen({}, rest), weak) for rest in (0.005e6, 0.05e6)] == ["iron_loss", None]
