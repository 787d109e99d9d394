"""Where a fit without a speed column begins: the shaft's speed of each window, and how many knots its load has."""

from dataclasses import replace

import numpy as np

from commissioner.estimation.fit import BUSY, MOST_BUSY, knot_times, plain_machine
from commissioner.estimation.record import prepare
from tests.running_effects.start import PLATE, started

TYPICAL = (1.3, 1.0, 0.012, 0.17)


def without_speed():
    return replace(started(PLATE), speed_rad_per_s=None)


def test_a_plugged_motor_still_turns_as_its_last_supply_drove_it():
    """It was begun in the new supply's direction: R_R of 0.73 for 1.02 ohm, after four starts in wrong valleys."""
    recording = without_speed()
    (a, b, c), (u, v, w) = recording.currents_a, recording.voltages_v
    later = recording.time_s > 1.2

    def exchanged(x, y):
        return np.where(later, y, x), np.where(later, x, y)

    plugged = replace(recording, currents_a=(a, *exchanged(b, c)), voltages_v=(u, *exchanged(v, w)))
    record = prepare([plugged], PLATE)
    before, after = record.windows
    assert before.direction == -after.direction
    assert np.sign(plain_machine(TYPICAL, record, has_shaft=True).first[1, 8]) == before.direction


def test_a_load_that_changes_all_the_time_has_as_many_knots_as_a_fit_can_bear():
    """1250 knots in 5 s: minutes of a processor, and a gigabyte."""
    record = prepare([without_speed()], PLATE)
    (window,) = record.windows
    long = replace(record, windows=(replace(window, state=np.full(window.count, BUSY)),))
    times = knot_times(long)[0]
    assert times.size < MOST_BUSY + 20
    assert np.diff(times)[:-1].max() < 0.02


def test_knots_around_one_load_step_keep_their_distance():
    record = prepare([without_speed()], PLATE)
    (window,) = record.windows
    state = np.zeros(window.count, np.int64)
    state[5000:5100] = BUSY
    times = knot_times(replace(record, windows=(replace(window, state=state),)))[0]
    near = times[(times > 0.98) & (times < 1.04)]
    assert np.sum(np.isclose(np.diff(near), 0.005, atol=1e-4)) >= 8
