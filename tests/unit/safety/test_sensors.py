"""Current sensors that lie are found by what they break: the axis' pattern, their own movement, the drive's magnitude."""

import math
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from commissioner.motor.space_vector import phase_cosines
from commissioner.records import SampleBlock
from commissioner.safety.sensors import (
    MISFIT,
    WINDOW_S,
    ZERO_S,
    SensorWatch,
    _culprit,
    _misfit,
    _opened,
    _smallest_step,
    _Zero,
)
from tests.unit.safety.test_watch import STATUS

PERIOD_S, LIMIT_A, ROWS = 2e-4, 10.0, 50
RNG = np.random.default_rng(3)
NOISE = RNG.normal(0.0, 0.003, (3, 40_000))


def blocks(
    axis_deg=0.0, peak_a=4.0, damage=lambda phases, start: phases, phases=3, offset=(0.02, -0.03, 0.01), rest=300
):
    """Zero volts for `rest` samples, at first a little longer than ZERO_S, then a ramp with a tone on it, block by block."""
    for number in range(14):
        start = number * ROWS
        time_s = (start + np.arange(ROWS)) * PERIOD_S
        voltage = np.where(start + np.arange(ROWS) < rest, 0.0, 20.0 + 10.0 * np.sin(200.0 * time_s))
        axis = peak_a / 30.0 * voltage
        angles = np.deg2rad(axis_deg) - 2.0 * np.pi / 3.0 * np.arange(3)
        seen = np.cos(angles)[:, None] * axis + NOISE[:, start : start + ROWS] + np.array(offset)[:, None]
        u, v, w = damage(seen, start)
        yield SampleBlock(
            session=1, first_index=start, sample_period_s=PERIOD_S, axis_deg=axis_deg, voltage_axis_v=voltage,
            current_u_a=u, current_v_a=v, current_w_a=w if phases == 3 else None, dc_link_v=540.0, lost_before=0,
            clipped=False,
        )  # fmt: skip


def verdict(**how):
    watch = SensorWatch(LIMIT_A)
    return next((reason for block in blocks(**how) if (reason := watch.judge(block)) is not None), None)


def of_phase(phase, change):
    def damage(seen, start):
        seen = seen.copy()
        seen[phase] = change(seen[phase])
        return seen

    return damage


@pytest.mark.parametrize("axis_deg", [0.0, 60.0, 120.0, 17.0])
@pytest.mark.parametrize("phases", [2, 3])
def test_true_sensors_are_believed(axis_deg, phases):
    assert verdict(axis_deg=axis_deg, phases=phases) is None


@pytest.mark.parametrize("gain", [0.92, 1.08])
def test_gains_that_differ_by_less_than_a_tenth_are_no_lie(gain):
    assert verdict(damage=of_phase(0, lambda i: gain * i)) is None


@pytest.mark.parametrize("axis_deg", [0.0, 60.0, 120.0])
@pytest.mark.parametrize("phase", [0, 1, 2])
@pytest.mark.parametrize(
    "change", [lambda i: -i, lambda i: 2.0 * i, lambda i: 0.4 * i], ids=["reversed", "doubled", "damped"]
)
def test_a_phase_of_foreign_sign_or_scale_is_named(axis_deg, phase, change):
    reason = verdict(axis_deg=axis_deg, damage=of_phase(phase, change))
    assert reason is not None and reason.is_fault
    assert "does not follow the test axis" in reason.what
    assert "uvw"[phase] in reason.what.split("phase ")[1].split(" does")[0]
    assert reason.value > 0.0 and "beside the axis" in str(reason.limit)


def test_phases_exchanged_are_seen():
    assert "does not follow" in verdict(axis_deg=17.0, damage=lambda seen, start: seen[[1, 0, 2]]).what


@pytest.mark.parametrize("phase", [0, 1, 2])
def test_a_phase_that_stands_still_is_named(phase):
    reason = verdict(damage=of_phase(phase, lambda i: np.full_like(i, 0.7)))
    assert f"phase {'uvw'[phase]} stands still" in reason.what
    assert reason.value == 0.0


def test_two_phases_that_stand_still_are_both_named():
    def damage(seen, start):
        return np.vstack([seen[:1], np.full((2, seen.shape[1]), 0.7)])

    assert "phase v and w stands still" in verdict(damage=damage).what


def test_three_sensors_that_stand_still_are_seen_at_a_small_current():
    """They agree with the axis, and no step has been seen of any."""

    def damage(seen, start):
        return np.outer([1.0, -0.5, -0.5], np.ones(seen.shape[1])) if start >= 250 else seen

    assert "phase u and v and w stands still" in verdict(damage=damage, offset=(0.0, 0.0, 0.0), rest=250).what


def test_a_phase_that_has_no_part_of_the_axis_may_stand_still():
    """At 90 degrees phase u carries nothing."""
    assert verdict(axis_deg=90.0, damage=of_phase(0, lambda i: np.full_like(i, 0.02))) is None


def test_two_sensors_alone_cannot_accuse_each_other():
    reason = verdict(axis_deg=17.0, phases=2, damage=of_phase(0, lambda i: -i))
    assert "phase u or v does not follow" in reason.what


def believed(**how):
    """Blocks before the first reason."""
    watch = SensorWatch(LIMIT_A)
    reasons = [watch.judge(block) is not None for block in blocks(damage=of_phase(0, lambda i: -3.0 * i), **how)]
    return reasons.index(True) if True in reasons else None


def test_the_first_window_is_judged_that_follows_the_rest_and_is_full():
    """Five blocks are ZERO_S, four are WINDOW_S: the sixth to the ninth are the first window."""
    assert pytest.approx((ZERO_S, WINDOW_S)) == (5 * ROWS * PERIOD_S, 4 * ROWS * PERIOD_S)
    assert believed() == 8


@pytest.mark.parametrize(("rest", "judged"), [(75, 5), (2, 4), (1, None), (0, None)])
def test_a_rest_that_is_cut_short_is_used_where_it_has_two_samples(rest, judged):
    assert believed(rest=rest) == judged


def test_what_was_learnt_at_rest_stays():
    with pytest.raises(FrozenInstanceError):
        _Zero(np.zeros(3), np.zeros(3)).noise_a = np.ones(3)


# --- one window, in closed form ---------------------------------------------------------------------------------------
ACROSS = 90.0
"""Degrees at which phase u carries nothing, and v and w the same."""


def window(current, voltage=(20.0, 30.0), *, axis_deg=ACROSS, noise_a=0.1):
    """Of two samples, each phase's current the same in both where one number is given."""
    seen = np.array([np.broadcast_to(phase, 2) for phase in current], dtype=float)
    return _misfit(seen, np.array(voltage), _Zero(np.zeros(len(seen)), np.full(len(seen), noise_a)), axis_deg)


@pytest.mark.parametrize(("u", "is_seen"), [(0.59, False), (0.61, True)])
def test_what_six_standard_deviations_of_noise_make_is_no_lie(u, is_seen):
    """Nothing flows along the axis: what phase u shows is all beside it."""
    assert (window(([u, -u], 0.0, 0.0), noise_a=0.1) is not None) is is_seen


@pytest.mark.parametrize(("u", "is_seen"), [(1.0, False), (1.1, True)])
def test_noise_and_misfit_add(u, is_seen):
    """Along the axis 4 / cos 30 deg flow: 0.12 of that and six times 0.08 are 1.034."""
    assert (window(([u, -u], [4.0, 4.1], [-4.0, -4.1]), noise_a=0.08) is not None) is is_seen


@pytest.mark.parametrize(("moves_v", "is_seen"), [(0.0, False), (1.0, False), (2.2, False), (3.0, True)])
def test_a_phase_may_stand_still_while_the_voltage_does(moves_v, is_seen):
    found = window((0.0, 4.0, -4.0), (20.0, 20.0 + moves_v))
    assert (found is not None) is is_seen
    assert not is_seen or "phase v and w stands still" in found.what


@pytest.mark.parametrize("noise_a", [0.0, 0.1])
def test_a_phase_may_stand_still_where_no_current_flows(noise_a):
    assert window((0.0, 0.0, 0.0), noise_a=noise_a) is None


def test_a_current_that_decays_without_voltage_may_stand_still():
    assert window((0.0, 4.0, -4.0), (0.0, 0.0)) is None


def test_two_phases_that_agree_to_the_last_digit_leave_the_third():
    assert _culprit(np.array([[2.0], [-0.5], [-0.5]]), np.array([1.0, -0.5, -0.5])) == "u"


def test_a_phase_of_two_sensors_that_stands_still_is_named():
    assert "phase v stands still" in window(([0.0, 0.1], 4.0)).what


def coarse(step_a, damage=lambda seen: seen):
    """What a converter of this step shows of sensors without noise."""
    return lambda seen, start: damage(step_a * np.floor(seen / step_a + 0.5))


@pytest.mark.parametrize("step_a", [0.1, 0.3, 1.0, 3.0, 7.0])
def test_a_coarse_converter_is_no_sensor_that_lies(step_a):
    """From a fortieth of the current to nearly twice of it; phases v and w carry half of what u does."""
    assert verdict(damage=coarse(step_a), offset=(0.0, 0.0, 0.0)) is None
    assert verdict(damage=coarse(step_a), offset=(0.9 * step_a, -0.8 * step_a, 1.1 * step_a)) is None


@pytest.mark.parametrize("axis_deg", [0.0, 60.0])
def test_behind_a_coarse_converter_a_lie_larger_than_its_steps_is_seen(axis_deg):
    frozen = verdict(
        damage=coarse(0.3, lambda seen: np.vstack([seen[:2], 0.0 * seen[2:]])),
        offset=(0.0, 0.0, 0.0),
        axis_deg=axis_deg,
    )
    assert "phase w stands still" in frozen.what
    damped = verdict(
        damage=coarse(0.3, lambda seen: seen * np.array([[1.0], [1.0], [0.0]]) + 0.3), offset=(0.0, 0.0, 0.0)
    )
    assert damped is not None


@pytest.mark.parametrize(("volts", "moves"), [([10.0, 20.0], 0.5), ([-20.0, 20.0], 1.0)])
@pytest.mark.parametrize("is_more", [False, True])
def test_a_phase_may_stand_still_that_should_move_by_no_more_than_two_steps(is_more, volts, moves):
    """Phase u has all of the axis current, and moves by what the voltage does of itself, by its size at the most."""
    cosines = np.array(phase_cosines(0.0))
    seen = np.outer(cosines, [3.0, 3.0])
    size_a = math.sqrt(float(np.mean(np.square(cosines @ seen / float(cosines @ cosines))))) * abs(cosines[0])
    step_a = 0.5 * moves * size_a * (0.99 if is_more else 1.0)
    found = _misfit(seen, np.array(volts), _Zero(np.zeros(3), np.zeros(3)), 0.0, step_a)
    assert (found is not None and "phase u stands still" in found.what) is is_more


@pytest.mark.parametrize(("u", "is_seen"), [(1.0, False), (1.1, True)])
def test_a_step_and_the_misfit_add(u, is_seen):
    """0.12 of 4 / cos 30 deg and a step of 0.48 are 1.034."""
    seen = np.array([[u, -u], [4.0, 4.1], [-4.0, -4.1]])
    found = _misfit(seen, np.array([20.0, 30.0]), _Zero(np.zeros(3), np.zeros(3)), ACROSS, 0.48)
    assert (found is not None) is is_seen


def test_the_smallest_step_is_kept():
    assert _smallest_step(np.array([[1.0, 1.0], [2.0, 2.0]]), 0.0) == 0.0
    assert _smallest_step(np.array([[1.0, 1.5], [2.0, 2.25]]), 0.0) == 0.25
    assert _smallest_step(np.array([[1.0, 1.0], [2.0, 2.0]]), 0.25) == 0.25
    assert _smallest_step(np.array([[1.0, 1.5], [2.0, 2.0]]), 0.25) == 0.25
    assert _smallest_step(np.array([[1.0, 1.125], [2.0, 2.0]]), 0.25) == 0.125


@pytest.mark.parametrize(("ratio", "names"), [(1.4, "u or v"), (2.0, "v")])
def test_two_phases_that_are_as_likely_are_both_named(ratio, names):
    """Errors x of u and y of v along 0 deg leave 0.5 y^2 without u, 0.2 x^2 without v, (x / 2 + y)^2 / 1.25 without w."""
    x, y = 1.0, np.sqrt(ratio * 0.2 / 0.5)
    current = np.array([[1.0 + x], [-0.5 + y], [-0.5]])
    assert _culprit(current, np.array([1.0, -0.5, -0.5])) == names


def test_offsets_are_no_currents():
    assert verdict(offset=(0.8, -0.5, 0.3)) is None


@pytest.mark.parametrize("over", [-0.002, 0.002])
def test_the_misfit_is_judged_at_its_edge(over):
    """A gain g of phase u along axis 0 leaves |g - 1| c^2 beside the rest's share; here measured on the pattern itself."""
    cosines = np.array([1.0, -0.5, -0.5])

    def misfit(gain):
        seen = cosines * np.array([gain, 1.0, 1.0])
        along = cosines @ seen / (cosines @ cosines)
        return np.max(np.abs(seen - cosines * along)) / along

    gains = np.linspace(1.0, 3.0, 20_001)
    edge = gains[np.argmax([misfit(g) > MISFIT for g in gains[::20]]) * 20]
    found = verdict(peak_a=400.0, damage=of_phase(0, lambda i: (edge + over * 20) * i), offset=(0.0, 0.0, 0.0))
    assert (found is not None) is (over > 0)


# --- against the drive's own magnitude ------------------------------------------------------------------------------
def claimed(block, magnitude_a, produced, *, energised=True):
    watch = SensorWatch(LIMIT_A)
    watch.claim(replace(STATUS, is_energised=energised, current_magnitude_a=magnitude_a, samples_produced=produced))
    return watch, watch.judge(block)


def a_block(first_index=100, peak_a=4.0, w=True):
    currents = np.zeros((3, 10))
    currents[:, 3] = [peak_a, -0.5 * peak_a, -0.5 * peak_a]
    return SampleBlock(
        session=1, first_index=first_index, sample_period_s=PERIOD_S, axis_deg=0.0, voltage_axis_v=np.zeros(10),
        current_u_a=currents[0], current_v_a=currents[1], current_w_a=currents[2] if w else None, dc_link_v=540.0,
        lost_before=0, clipped=False,
    )  # fmt: skip


def test_the_same_sample_is_compared():
    assert claimed(a_block(), 4.0, 104)[1] is None
    reason = claimed(a_block(), 8.0, 104)[1]
    assert reason.is_fault and "own current magnitude differ" in reason.what
    assert (reason.value, reason.limit) == (4.0, "8 A")
    assert claimed(a_block(), 2.0, 104)[1] is not None


def test_of_two_sensors_the_third_phase_follows_from_the_sum():
    block = a_block(w=False)
    block = replace(block, current_u_a=0.5 * block.current_u_a, current_v_a=-0.5 * block.current_v_a)
    assert claimed(block, 3.0, 104)[1] is None
    assert claimed(block, 2.0, 104)[1] is not None


def test_of_three_sensors_the_largest_is_compared_whatever_their_sum():
    block = a_block()
    block = replace(block, current_v_a=block.current_u_a, current_w_a=block.current_u_a)
    assert claimed(block, 4.0, 104)[1] is None


@pytest.mark.parametrize(("w", "floor"), [(True, 0.004), (False, 0.012)])
@pytest.mark.parametrize(("off", "passes"), [(-1e-6, True), (1e-6, False)])
def test_the_allowed_difference_is_a_tenth_of_the_larger_and_a_floor(off, passes, w, floor):
    """Three times the floor where a third current is the sum of two."""
    larger = (4.0 + floor * LIMIT_A) / 0.9 + off
    assert (claimed(a_block(w=w), larger, 104)[1] is None) is passes
    smaller = 4.0 * 0.9 - floor * LIMIT_A - off
    assert (claimed(a_block(w=w), smaller, 104)[1] is None) is passes


def test_a_claim_waits_for_its_sample_and_one_that_is_gone_is_dropped():
    watch, reason = claimed(a_block(), 8.0, 114)
    assert reason is None
    assert watch.judge(a_block(first_index=110)) is not None
    watch, reason = claimed(a_block(), 8.0, 100)
    assert reason is None
    assert watch.judge(a_block(first_index=90)) is None
    assert claimed(a_block(), 8.0, 101)[1] is not None  # sample 100, the block's first: 0 A there
    assert claimed(a_block(), 8.0, 110)[1] is not None  # its last
    assert claimed(a_block(), 8.0, 111)[1] is None


@pytest.mark.parametrize(
    ("magnitude", "produced", "energised"), [(math.nan, 104, True), (8.0, 0, True), (8.0, 104, False)]
)
def test_a_drive_that_says_nothing_is_not_compared(magnitude, produced, energised):
    assert (
        claimed(a_block(first_index=0 if produced == 0 else 100), magnitude, produced, energised=energised)[1] is None
    )


def test_one_sample_is_a_claim():
    assert claimed(a_block(first_index=0), 8.0, 1)[1] is not None


@pytest.mark.parametrize("noise_a", [0.0, 0.01])
@pytest.mark.parametrize(("over", "passes"), [(0.999, True), (1.001, False)])
def test_the_drives_word_may_be_a_neighbours_by_five_standard_deviations_of_noise(noise_a, over, passes):
    """Where no current flows: what is left of a tenth, 0.004 of the limit, and five times the noise seen at rest."""
    watch = SensorWatch(LIMIT_A)
    watch._zero = _Zero(np.zeros(3), np.array([0.0, noise_a, 0.0]))
    said_a = over * (0.004 * LIMIT_A + 5.0 * noise_a) / 0.9
    watch.claim(replace(STATUS, is_energised=True, current_magnitude_a=said_a, samples_produced=104))
    assert (watch.judge(a_block(peak_a=0.0)) is None) is passes


def single_phase(phase, axis_deg, peak_a=4.0, noise=1.0, leak=0.0, step_a=1e-9):
    """Currents of a motor whose `phase` is open: the others carry one current, there and back, as their voltages drive it."""

    def damage(seen, start):
        forth, back = (other for other in range(3) if other != phase)
        through = (seen[forth] - seen[back]) / 2.0
        out = noise * NOISE[:, start : start + seen.shape[1]]
        out[forth], out[back], out[phase] = out[forth] + through, out[back] - through, out[phase] + leak * through
        return step_a * np.round(out / step_a)

    return verdict(axis_deg=axis_deg, peak_a=peak_a, damage=damage, offset=(0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("phase", "axis_deg"), [(1, 0.0), (2, 0.0), (0, 60.0), (1, 60.0), (0, 120.0), (2, 120.0), (1, 90.0)]
)
def test_an_open_phase_is_named_as_one_and_is_no_sensors_fault(phase, axis_deg):
    reason = single_phase(phase, axis_deg, peak_a=8.0)
    assert reason is not None
    assert reason.what.startswith(f"phase {'uvw'[phase]} carries no current")
    assert not reason.is_fault
    assert reason.value < 0.01
    asked_a = abs(phase_cosines(axis_deg)[phase]) * single_phase_size(phase, axis_deg, 8.0)
    assert float(reason.limit.removesuffix(" A")) == pytest.approx(asked_a, rel=0.2)


def opening(phase, row, axis_deg=0.0):
    """As `single_phase`, from this row on; before it sound currents."""

    def damage(seen, start):
        forth, back = (other for other in range(3) if other != phase)
        through = (seen[forth] - seen[back]) / 2.0
        out = seen.copy()
        is_open = start + np.arange(seen.shape[1]) >= row
        out[forth, is_open], out[back, is_open], out[phase, is_open] = (
            through[is_open],
            -through[is_open],
            NOISE[0, start : start + seen.shape[1]][is_open],
        )
        return out

    return verdict(axis_deg=axis_deg, peak_a=8.0, damage=damage, offset=(0.0, 0.0, 0.0))


@pytest.mark.parametrize(("phase", "axis_deg"), [(1, 0.0), (0, 60.0), (2, 120.0)])
@pytest.mark.parametrize("row", range(405, 600, 15))
def test_a_phase_that_opens_in_a_test_is_named_wherever_in_a_window(row, phase, axis_deg):
    """A window that holds both had accused a sensor: from 0.06 of it on a misfit shows, and the whole of it is no open phase."""
    reason = opening(phase, row, axis_deg)
    assert (
        reason is not None
        and reason.what.startswith(f"phase {'uvw'[phase]} carries no current")
        and not reason.is_fault
    )
    assert reason.value < 0.3 * float(reason.limit.removesuffix(" A"))


@pytest.mark.parametrize("rad_per_s", [40.0, -40.0, 150.0, 400.0])
@pytest.mark.parametrize("since_s", np.linspace(0.07, 0.1, 7))
def test_currents_that_turn_away_from_the_axis_are_no_open_phase(rad_per_s, since_s):
    """Of a turning shaft: their sum is nothing, and one after the other passes its zero, also at the end of a window."""

    def damage(seen, start):
        time_s = (start + np.arange(seen.shape[1])) * PERIOD_S
        angle = rad_per_s * np.maximum(time_s - since_s, 0.0)
        return (
            2.0
            / 3.0
            * (seen[0] - seen[1] / 2.0 - seen[2] / 2.0)
            * np.array([np.cos(angle - 2.0 * np.pi / 3.0 * k) for k in range(3)])
        )

    reason = verdict(peak_a=8.0, damage=damage, offset=(0.0, 0.0, 0.0))
    assert reason is not None and "does not follow the test axis" in reason.what


def single_phase_size(phase, axis_deg, peak_a):
    """Current along the axis, rms of a sine, that flows through the two other phases, as half their difference drives it."""
    cosines = phase_cosines(axis_deg)
    forth, back = (cosines[other] for other in range(3) if other != phase)
    return peak_a / math.sqrt(2.0) * (forth - back) ** 2 / 3.0


def test_a_gain_that_is_low_beside_a_phase_with_hardly_any_current_is_no_open_phase():
    """A tenth of the axis current is what an open phase may show; at 84 deg a sound one shows no more."""
    assert verdict(axis_deg=84.03, damage=of_phase(0, lambda i: 0.94 * i), offset=(0.0, 0.0, 0.0)) is None


@pytest.mark.parametrize(
    "how",
    [
        {"peak_a": 3.0, "noise": 20.0},
        {"peak_a": 8.0},
        {"peak_a": 8.0, "leak": 0.06},
        {"step_a": 0.1},
        {"leak": 0.1, "step_a": 0.5},
    ],
    ids=["noise", "large", "leak", "one and the same number of a coarse converter", "steps of a coarse converter"],
)
def test_an_open_phase_is_named_beside_noise_and_a_leak_and_at_any_size(how):
    reason = single_phase(1, 0.0, **how)
    assert reason is not None
    assert reason.what.startswith("phase v carries no current")


@pytest.mark.parametrize("phase", [0, 1, 2])
def test_a_silent_sensor_is_no_open_phase(phase):
    """Its phase carries a current, which the other two sensors do not add up to zero without."""
    reason = verdict(axis_deg=15.0, damage=of_phase(phase, lambda i: NOISE[0, : i.size]))
    assert reason is not None
    assert "sensor" in reason.what
    assert reason.is_fault


def stopping(after, voltage_v, current_a, seconds=1.0, axis_deg=0.0, step_a=1e-9, offset_a=0.0):
    """A window watch over a current that is there until `after` (s), and the time of what it says."""
    watch, noise = SensorWatch(LIMIT_A), np.random.default_rng(5)
    cosines = np.array(phase_cosines(axis_deg))[:, None]
    for number in range(round(seconds / (ROWS * PERIOD_S))):
        time_s = (number * ROWS + np.arange(ROWS)) * PERIOD_S
        on = time_s >= ZERO_S
        volts = np.where(on, voltage_v(time_s), 0.0)
        axis = np.where(on & (time_s < after), current_a(time_s), 0.0)
        u, v, w = step_a * np.round((cosines * axis + offset_a + noise.normal(0.0, 0.003, (3, ROWS))) / step_a)
        block = SampleBlock(
            session=1, first_index=number * ROWS, sample_period_s=PERIOD_S, axis_deg=axis_deg, voltage_axis_v=volts, current_u_a=u,
            current_v_a=v, current_w_a=w, dc_link_v=540.0, lost_before=0, clipped=False,
        )  # fmt: skip
        if (reason := watch.judge(block)) is not None:
            return reason, float(time_s[-1])
    return None, seconds


@pytest.mark.parametrize(("hertz", "axis_deg"), [(0.0, 0.0), (2.0, 90.0), (50.0, 0.0)])
def test_a_contactor_that_opens_in_a_test_is_seen_in_a_fifth_of_a_second(hertz, axis_deg):
    """At 90 deg one phase carries nothing before it opens, either."""
    reason, seen_s = stopping(
        0.6,
        lambda t: 2.0 + 20.0 * np.cos(2 * np.pi * hertz * t),
        lambda t: 4.0 * np.cos(2 * np.pi * hertz * t),
        axis_deg=axis_deg,
    )
    assert reason is not None
    assert reason.what.startswith("no current flows any more")
    assert not reason.is_fault
    assert 0.6 < seen_s <= 0.6 + (0.2 if hertz == 0.0 else 0.4)


@pytest.mark.parametrize("hertz", [0.7, 2.0, 20.0])
def test_a_current_that_only_passes_through_zero_has_not_stopped(hertz):
    """A quarter of a period behind its voltage, which is at its peak then."""
    reason, _ = stopping(
        9.0, lambda t: 20.0 * np.cos(2 * np.pi * hertz * t), lambda t: 0.6 * np.sin(2 * np.pi * hertz * t), 3.0
    )
    assert reason is None


@pytest.mark.parametrize("step_a", [1e-9, 0.05])
def test_voltage_that_drove_no_current_yet_is_no_current_that_stopped(step_a):
    """A climb through an inverter's dead band, and the end of a test: its voltage is small before its current is."""
    reason, _ = stopping(9.0, lambda t: 10.0 * t, lambda t: np.maximum(t - 0.8, 0.0), 2.0, step_a=step_a)
    assert reason is None


def test_a_current_that_stopped_is_seen_by_a_coarse_converter():
    reason, seen_s = stopping(0.6, lambda t: 20.0 + 0.0 * t, lambda t: 4.0 + 0.0 * t, step_a=0.05)
    assert reason is not None
    assert seen_s < 0.8


def test_a_current_that_is_back_after_a_twentieth_of_a_second_has_not_stopped():
    reason, _ = stopping(9.0, lambda t: 20.0 + 0.0 * t, lambda t: np.where((t > 0.6) & (t < 0.65), 0.0, 4.0))
    assert reason is None


@pytest.mark.parametrize("step_a", [1e-9, 0.5])
def test_a_smaller_voltage_than_drove_the_current_may_drive_none(step_a):
    """What an inverter loses takes all of it, as on the way down, however long that lasts."""
    reason, _ = stopping(
        0.6, lambda t: np.where(t < 0.6, 20.0, 10.0), lambda t: 4.0 + np.sin(300.0 * t), 14.0, step_a=step_a
    )
    assert reason is None


def test_a_current_that_stopped_is_seen_beside_offsets():
    reason, _ = stopping(0.6, lambda t: 20.0 * np.cos(300.0 * t), lambda t: 4.0 * np.cos(300.0 * t), offset_a=0.4)
    assert reason is not None
    assert reason.what.startswith("no current flows any more")


def test_a_current_that_a_smaller_voltage_does_not_drive_has_not_stopped():
    """What an inverter loses may take all of four fifths of a voltage that drove one."""
    reason, _ = stopping(
        0.6, lambda t: np.where(t < 0.6, 20.0, 16.0) * np.cos(300.0 * t), lambda t: 4.0 * np.cos(300.0 * t)
    )
    assert reason is None


def test_a_current_below_a_converters_step_has_not_surely_flowed():
    reason, _ = stopping(0.6, lambda t: 20.0 * np.cos(300.0 * t), lambda t: 0.07 * np.cos(300.0 * t), step_a=0.1)
    assert reason is None


def test_the_smallest_step_is_between_any_two_values_of_one_phase():
    """In whatever order they came, and never between two phases."""
    seen = np.array([[0.0, 1.0, 0.3], [5.0, 5.9, 5.0], [0.1, 0.1, 0.1]])
    assert _smallest_step(seen, 0.0) == pytest.approx(0.3)
    assert _smallest_step(seen, 0.2) == 0.2
    assert _smallest_step(np.ones((3, 4)), 0.0) == 0.0


def opened_at(rows, open_rows, beside_a=0.0):
    """Currents of axis 0, 2 A along it and `beside_a` across it, in the last rows through u and w alone, `(3, rows)`."""
    seen = np.tile([[2.0], [-1.0 + beside_a], [-1.0 - beside_a]], rows)
    seen[:, rows - open_rows :] = [[2.0], [0.0], [-2.0]]
    return seen


def opened(seen, noise_a=0.0, step_a=0.0):
    return _opened(seen, np.array(phase_cosines(0.0)), noise_a, step_a)


@pytest.mark.parametrize(("rows", "open_rows"), [(160, 10), (160, 160), (16, 1), (240, 15), (10, 1)])
def test_a_phase_that_is_open_in_the_last_sixteenth_is_found(rows, open_rows):
    reason = opened(opened_at(rows, open_rows))
    assert reason is not None and reason.what.startswith("phase v carries no current")


def test_before_a_phase_opens_the_currents_follow_the_axis_but_for_noise_and_a_step():
    allowed = {"noise_a": 0.02, "step_a": 0.01}
    assert opened(opened_at(160, 80, 2.0 * MISFIT + 0.025), **allowed) is not None
    assert opened(opened_at(160, 80, 2.0 * MISFIT + 0.035), **allowed) is None
