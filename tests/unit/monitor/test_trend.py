"""The trend: a threshold that knows how little few recordings know."""

from __future__ import annotations

import numpy as np
import pytest

from commissioner.errors import ConfigurationError
from commissioner.monitor.trend.trend import Entry, History, State, compare, judge
from commissioner.recordings.baseline import VERSION, read, update


def entry(value: float, torque: float = 10.0, noise: float = 0.1, name: str = "ripple") -> Entry:
    return Entry("file", 150.0, torque, 50.0, {name: (value, noise)})


def history(count: int, seed: int = 1) -> History:
    rng = np.random.default_rng(seed)
    return History(tuple(entry(1.0 + 0.1 * x) for x in rng.standard_normal(count)))


@pytest.mark.parametrize("learned", [3, 5, 20])
def test_two_thousand_healthy_values_raise_no_alarm(learned: int) -> None:
    alarms = 0
    for seed in range(20):
        past = history(learned, seed)
        rng = np.random.default_rng([seed, 5])
        alarms += sum(judge(entry(1.0 + 0.1 * x), past).state is State.ALARM for x in rng.standard_normal(100))
    assert alarms == 0


def test_a_value_ten_standard_deviations_away_alarms_and_says_which() -> None:
    verdict = judge(entry(2.0), history(10))
    assert verdict.state is State.ALARM
    assert verdict.names == ("ripple",)
    assert verdict.watched[0].distance == pytest.approx(10, abs=4)


def test_noise_larger_than_claimed_widens_the_range() -> None:
    rng = np.random.default_rng(8)
    restless = [entry(1.0 + 1.0 * x) for x in rng.standard_normal(30)]
    assert not compare(entry(3.5), restless)[0].alarms
    assert compare(entry(3.5), list(history(30).healthy))[0].alarms


def test_fewer_than_three_recordings_give_no_verdict() -> None:
    verdict = judge(entry(5.0), history(2))
    assert verdict.state is State.TOO_FEW
    assert "2, of at least 3" in verdict.sentence


def test_another_operating_point_is_not_compared() -> None:
    verdict = judge(entry(5.0, torque=13.0), history(10))
    assert verdict.state is State.TOO_FEW
    assert verdict.other_operating_points == 10


def test_the_first_recording_is_learned_and_later_ones_are_judged(tmp_path) -> None:
    path = tmp_path / "machine.json"
    assert update(path, entry(1.0), learn=False)[0].state is State.STORED
    for value in (1.05, 0.95, 1.02):
        update(path, entry(value), learn=True)
    assert update(path, entry(1.1), learn=False)[0].state is State.NORMAL
    assert update(path, entry(3.0), learn=False)[0].state is State.ALARM
    kept = read(path)
    assert (len(kept.healthy), len(kept.judged)) == (4, 2)
    assert kept.judged[-1].indicators["ripple"] == (3.0, 0.1)


def test_an_alarming_recording_is_not_called_healthy_when_learned(tmp_path) -> None:
    path = tmp_path / "machine.json"
    for value in (1.0, 1.05, 0.95, 1.02):
        update(path, entry(value), learn=True)
    assert update(path, entry(9.0), learn=True)[0].state is State.ALARM


def test_a_file_that_is_no_baseline_is_named(tmp_path) -> None:
    path = tmp_path / "machine.json"
    path.write_text('{"version": 7}')
    with pytest.raises(ConfigurationError, match=r"machine\.json"):
        read(path)


@pytest.mark.parametrize("indicators", ["[]", "7", '{"a": 1}', '{"a": [1, 2, 3]}', '{"a": ["x", null]}', str(10**400)])
def test_an_entry_that_is_none_is_no_baseline(tmp_path, indicators) -> None:
    path = tmp_path / "fan.json"
    entry = f'{{"source": "a", "speed_rad_per_s": 1, "torque_nm": 1, "supply_hz": 1, "indicators": {indicators}}}'
    path.write_text(f'{{"version": {VERSION}, "healthy": [{entry}], "judged": []}}', "utf-8")
    with pytest.raises(ConfigurationError):
        read(path)
