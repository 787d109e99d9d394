"""Heat that leaks away while the recording goes on: its courses, their sum as one, and its name and size in simulated recordings."""

import copy

import numpy as np
import pytest
from scipy.optimize import nnls

from commissioner.diagnose.causes.machine.warming import warming
from commissioner.diagnose.causes.regressors import HEAT_LEAKS_S, _doses
from commissioner.diagnose.diagnosis import diagnose
from sim.recordings import hidden
from sim.scenario import build
from tests.hidden_effects.cases import recording_of
from tests.unit.diagnose.conftest import PERIOD_S

SEED = 5


def stepped(record, rates, leak_s):
    """Doses by the smallest steps, through the segments and the pauses between them."""
    held, out = 0.0, []
    for k, rate in enumerate(rates):
        if k:
            pause = record.segments[k].time_s[0] - record.segments[k - 1].time_s[-1] - PERIOD_S
            held *= np.exp(-pause / leak_s)
        course = []
        for x in rate[0]:
            course.append(held)
            held = (held + x) * np.exp(-PERIOD_S / leak_s)
        out.append(np.array(course))
    return out


@pytest.mark.parametrize("leak_s", [0.5, 6.0, np.inf])
def test_doses_leak_away_in_segments_and_in_pauses(setting, leak_s):
    rates = [s.currents_a[:1] ** 2 for s in setting.record.segments]
    for ours, theirs in zip(_doses(setting.record, rates, leak_s), stepped(setting.record, rates, leak_s), strict=True):
        assert np.abs(ours[0] - theirs).max() < 1e-3 * theirs.max()


@pytest.mark.parametrize("leak_s", [8.0, 12.0, 40.0])
def test_leaks_in_place_of_one_between_them_read_as_that_one(setting, leak_s):
    """0.3 per minute at first, whatever the sum of the parts says."""
    record = setting.record
    ends = ["mean" + end for end in HEAT_LEAKS_S]
    doses = [c[:, record.channel("heat_mean_u")] for c in record.channels]
    rates = [np.diff(dose, append=dose[-1])[None] for dose in doses]
    wanted = np.concatenate([x[0] for x in _doses(record, rates, leak_s)])
    courses = np.concatenate([c[:, [record.channel(f"heat_{n}_u") for n in ends]] for c in record.channels])
    with_rest = np.c_[courses, np.ones(wanted.size), -np.ones(wanted.size)]
    parts = 0.3 * nnls(with_rest, wanted)[0][: len(ends)]
    rise, leak = warming(setting, dict(zip(ends, parts, strict=True)))
    assert rise == pytest.approx(0.3, rel=0.01) and 1.0 / leak == pytest.approx(leak_s, rel=0.25)


@pytest.mark.parametrize(
    ("name", "rise", "leak_s"),
    [("rotor_heating", 3.0, 8.0), ("rotor_heating", 2.0, 25.0), ("stator_heating", 0.3, 12.0)],
)
def test_heat_that_leaks_away_within_the_recording_is_named_with_its_first_rise(name, rise, leak_s):
    document = copy.deepcopy(hidden.draw(SEED, "one", only=name, noise="white", seconds=3.0).document)
    machine = document["machine"]
    # the loss of the cage is the same in both circuits, its current is not
    ratio = 1.0 + machine["leakage_inductance_h"] / machine["inductance_h"] if name == "rotor_heating" else 1.0
    document["effects"] = {name: {"size": rise, "time_constant_s": leak_s}}
    seen = diagnose([recording_of(build(document, "warm"), SEED)])
    assert [c.name for c in seen.causes] == [name] and seen.verdict == "explained"
    assert seen.causes[0].sizes["rise_per_minute_at_rated_current"][0] == pytest.approx(rise / ratio**2, rel=0.05)
