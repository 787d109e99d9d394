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
from commissioner.diagnose.search.screening import joint_net, screen
from commissioner.diagnose.search.stepwise import RuledOut, Steps

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


def test_a_cause_that_takes_nearly_all_of_a_large_rest_is_no_part_of_anothers_form(setting):
    steps = Steps(setting, WHITE, ["inductance_anisotropy"], print, setting.record, lambda: True)
    losses = {"shaft_motion": 1e8}
    large, small = 0.05 * steps.count, 0.005 * steps.count
    asked = [steps._guard(losses, "inductance_anisotropy", rest) for rest in (large, small, 1e9)]
    assert asked == pytest.approx(
        [RULES.entirely_share * large, guard(losses, "inductance_anisotropy"), guard(losses, "inductance_anisotropy")]
    )


def test_what_samples_left_out_might_hold_is_not_asked_for(setting):
    def asked(record):
        steps = Steps(replace(setting, record=record), WHITE, [], print, record, lambda: True)
        return steps.count, steps.material_chi2

    record = setting.record
    half = tuple(replace(s, is_good=np.arange(s.count) % 2 == 0) for s in record.segments)
    whole, left_out = asked(record), asked(replace(record, segments=half))
    assert left_out == pytest.approx([0.5 * x for x in whole], rel=1e-3)


def test_beside_what_a_cause_that_was_ruled_out_would_take_a_weak_one_is_not_named(late, setting, nominal):
    """A sag of a link that stands still takes ten times what any other does: it is real, and six weak causes are not its name."""
    steps = Steps(replace(setting, record=late), WHITE, ["sampling_delay", "iron_loss"], print, late, lambda: True)
    screening = promised(nominal, late, setting, steps.names)
    guards = dict.fromkeys(steps.names, 100.0)
    assert steps._most_ruled_out(screening, guards) == RuledOut()
    steps.kept_of_ruled_out["sampling_delay"] = 0.5
    ruled_out = steps.ruled_out = steps._most_ruled_out(screening, guards)
    assert (
        ruled_out.chi2 == pytest.approx(0.5 * screening.scores["sampling_delay"].delta_chi2)
        and ruled_out.chi2 > steps.material_chi2
    )
    assert steps._least_chi2_of_rest(0.0) == RULES.least_share_of_rest * ruled_out.chi2
    assert steps._most_ruled_out(screening, guards | {"sampling_delay": 2.0 * ruled_out.chi2}) == RuledOut()
    small, large = 0.005 * steps.count, 0.05 * steps.count
    steps.ruled_out = RuledOut()
    assert [steps._least_chi2_of_rest(rest) for rest in (small, large)] == [0.0, RULES.least_share_of_rest * large]
