"""Three channels that are no lines of one motor, and single samples that stand out of a recording."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.errors import DataRefused
from commissioner.estimation.channels import check_sums, without_spikes
from commissioner.estimation.record import prepare, scales_of
from tests.running_effects.cases import Case, taken


@pytest.fixture(scope="module")
def start():
    recording, plate, _ = taken(Case(5000, "null").scenario(), 5000)
    return recording, plate


def with_channel(recording, kind, k, change):
    """`change` of the three channels stands in the place of channel k."""
    group = list(getattr(recording, kind))
    group[k] = change(*group)
    return replace(recording, **{kind: tuple(group)})


@pytest.mark.parametrize(
    ("kind", "k", "change", "says"),
    [
        ("currents_a", 1, lambda u, v, w: u, "currents u and v are one and the same"),
        ("currents_a", 2, lambda u, v, w: 10.0 * w, "current w is 10 times what the other two leave for it"),
        ("currents_a", 0, lambda u, v, w: 1.6 * u, "current u is 1.6 times"),
        ("currents_a", 0, lambda u, v, w: np.abs(u), "one of them at least is something else"),
        ("currents_a", 1, lambda u, v, w: 0.02 * np.random.default_rng(1).standard_normal(u.size), "something else"),
        ("voltages_v", 0, lambda u, v, w: v, "voltages u and v are one and the same"),
        ("voltages_v", 2, lambda u, v, w: 0.1 * w, "voltage w is 0.1 times what the other two leave for it"),
    ],
)
def test_channels_that_are_no_lines_of_one_motor_are_named(start, kind, k, change, says):
    recording, plate = start
    check_sums(recording, scales_of(plate))
    with pytest.raises(DataRefused) as refused:
        prepare([with_channel(recording, kind, k, change)], plate)
    assert says in refused.value.what and "add up to zero" in refused.value.what


def test_a_gain_that_a_cause_can_name_and_an_offset_are_left_to_the_causes(start):
    recording, plate = start
    noise = 0.02 * np.random.default_rng(2).standard_normal((3, recording.time_s.size))
    for one in (
        with_channel(recording, "currents_a", 1, lambda u, v, w: 1.2 * v + 3.0),
        with_channel(recording, "voltages_v", 1, lambda u, v, w: 1.2 * v),
        with_channel(recording, "currents_a", 2, lambda u, v, w: np.full(u.size, np.nan)),
        replace(recording, currents_a=tuple(noise)),
    ):
        check_sums(one, scales_of(plate))


def test_single_samples_that_stand_out_are_as_their_neighbours_tell_and_a_closing_contactor_makes_none(start):
    recording, _ = start
    assert without_spikes(recording) == (recording, [])
    rng = np.random.default_rng(3)
    at = np.sort(rng.choice(np.arange(50, recording.time_s.size - 50, 10), 12, replace=False))

    def hit(u, v, w):
        out = v.copy()
        out[at] += rng.choice([-1.0, 1.0], at.size) * 40.0
        return out

    mended, (said,) = without_spikes(with_channel(recording, "currents_a", 1, hit))
    assert "12 samples stand out" in said
    off = mended.currents_a[1] - recording.currents_a[1]
    assert np.flatnonzero(off).tolist() == at.tolist()
    assert np.abs(off).max() < 0.02 * np.abs(recording.currents_a[1]).max()
    noisy = with_channel(recording, "currents_a", 1, lambda u, v, w: v + 40.0 * (rng.random(v.size) < 0.05))
    assert without_spikes(noisy)[1] == []
