"""Tables of test points: constant circuits are left alone, extended ones are named with their size."""

import numpy as np
import pytest

from commissioner.diagnose.document import points_document
from commissioner.diagnose.points.diagnosis import diagnose_points
from commissioner.diagnose.points.table import read_points
from commissioner.errors import DataRefused
from commissioner.report.diagnosis.page import points_page
from commissioner.report.diagnosis.words import headline
from commissioner.report.page import Picture
from tests.support.standstill import usable_motors

MOTORS = [m for m in usable_motors() if m.plate.rated_power_w > 300.0][::7]


def locked(motor, random, scatter, skin=0.0, saturation=0.0):
    """Twelve points at two frequencies, currents from 0.35 to 1.1 rated; sizes over the table's range."""
    r_s, r_r, leak, _ = motor.truth
    i = np.tile(np.linspace(0.35, 1.1, 6), 2) * motor.plate.rated_current_a
    f = np.repeat([1.0, 1.2], 6) * motor.plate.rated_frequency_hz
    rise = 1.0 + skin * ((f / f.min()) ** 2 - 1.0) / (1.2**2 - 1.0)
    along = (i - i.min()) / np.ptp(i)
    reactance = 2 * np.pi * f * leak * (1.0 - saturation * along)
    resistance = r_s + r_r * rise
    v = np.sqrt(3.0) * i * np.hypot(resistance, reactance)
    return _table(f, v, i, 3.0 * resistance * i**2, random, scatter) | {
        "winding_resistance_uv_ohm": np.full(12, 2.0 * r_s)
    }


def no_load(motor, random, scatter, saturation=0.0, growth=0.0):
    """Ten voltages from 0.4 to 1.1 rated; `saturation` extra current and `growth` share of the loss at the highest."""
    r_s, _, leak, main = motor.truth
    f = np.full(10, motor.plate.rated_frequency_hz)
    v = np.linspace(0.4, 1.1, 10) * motor.plate.rated_voltage_v
    loss = 0.04 * motor.plate.rated_power_w * (1.0 - growth + growth * (v / v.max()) ** 2)
    reactive = v / np.sqrt(3.0) / (2 * np.pi * f * (main + leak)) * (1.0 + saturation * (v / v.max()) ** 7)
    i = np.hypot(reactive, loss / (np.sqrt(3.0) * v))
    return _table(f, v, i, loss + 3.0 * r_s * i**2, random, scatter) | {
        "winding_resistance_uv_ohm": np.full(10, 2.0 * r_s)
    }


def _table(f, v, i, p, random, scatter):
    shaken = [x * (1.0 + scatter * random.standard_normal(x.size)) for x in (v, i, p)]
    return dict(zip(("frequency_hz", "voltage_line_v", "current_line_a", "power_w"), (f, *shaken), strict=True))


def named(columns, name="points"):
    seen = diagnose_points(read_points(columns, name))
    return {c.name: c for c in seen.causes}, seen


@pytest.mark.parametrize("motor", MOTORS, ids=lambda m: m.name)
@pytest.mark.parametrize("scatter", [0.001, 0.01])
def test_nothing_is_found_in_a_locked_rotor_of_constant_parameters(motor, scatter):
    for seed in range(2):
        causes, seen = named(locked(motor, np.random.default_rng(seed), scatter))
        assert seen.verdict == "nothing_significant", causes


@pytest.mark.parametrize("motor", MOTORS, ids=lambda m: m.name)
@pytest.mark.parametrize("scatter", [0.001, 0.01])
def test_nothing_is_found_at_no_load_with_constant_inductance_and_loss(motor, scatter):
    for seed in range(2):
        causes, seen = named(no_load(motor, np.random.default_rng(seed), scatter), "no_load")
        assert seen.verdict == "nothing_significant", causes


@pytest.mark.parametrize("motor", MOTORS, ids=lambda m: m.name)
def test_skin_effect_and_leakage_saturation_are_named_together_with_their_sizes(motor):
    causes, seen = named(locked(motor, np.random.default_rng(4), 0.002, skin=0.15, saturation=0.12))
    assert set(causes) == {"rotor_skin_effect", "leakage_saturation"}
    rise, spread, _ = causes["rotor_skin_effect"].sizes["resistance_rise_over_range"]
    assert rise == pytest.approx(0.15, abs=max(4.0 * spread, 0.02))
    assert causes["leakage_saturation"].sizes["inductance_drop_over_range"][0] == pytest.approx(0.12, abs=0.02)
    assert seen.relative_after < 0.4 * seen.relative_before


@pytest.mark.parametrize("motor", MOTORS, ids=lambda m: m.name)
def test_one_cause_does_not_bring_the_other(motor):
    assert set(named(locked(motor, np.random.default_rng(5), 0.003, saturation=0.1))[0]) == {"leakage_saturation"}
    assert set(named(locked(motor, np.random.default_rng(6), 0.003, skin=0.2))[0]) == {"rotor_skin_effect"}


@pytest.mark.parametrize("motor", MOTORS, ids=lambda m: m.name)
def test_saturation_and_growing_loss_are_named_at_no_load(motor):
    causes, _ = named(no_load(motor, np.random.default_rng(7), 0.003, saturation=0.5, growth=0.6), "no_load")
    assert set(causes) == {"magnetizing_saturation", "iron_loss"}
    assert causes["magnetizing_saturation"].sizes["extra_current_at_highest_flux"][0] == pytest.approx(0.5, abs=0.06)


def test_the_kind_of_test_is_told_from_the_numbers():
    for motor in MOTORS:
        random = np.random.default_rng(8)
        assert read_points(locked(motor, random, 0.01), "table").is_locked
        assert not read_points(no_load(motor, random, 0.01), "table").is_locked


def refusal(columns, name="points"):
    seen = read_points(columns, name)
    assert isinstance(seen, DataRefused), seen
    assert seen.step and seen.value is not None and seen.limit and seen.remedy
    return seen.what


def test_what_cannot_be_used_is_refused_with_the_row_the_limit_and_the_remedy():
    columns = locked(MOTORS[0], np.random.default_rng(9), 0.0)
    some = {k: v[:3] for k, v in columns.items()}
    assert "3 different points" in refusal(some)
    assert "3 different points" in refusal({k: np.repeat(v, 4) for k, v in some.items()})
    assert "exceeds the apparent power" in refusal(columns | {"power_w": columns["power_w"] * 10.0})
    assert "power factor of 0.000" in refusal(columns | {"power_w": columns["power_w"] * 1e-3})
    assert refusal(columns | {"current_line_a": np.r_[1.0, -1.0, np.ones(10)]}) == "current_line_a is -1 in row 2"
    assert "needs the column power_w" in refusal({k: v for k, v in columns.items() if k != "power_w"})
    loaded = columns | {"frequency_hz": np.full(12, 50.0), "voltage_line_v": np.full(12, 400.0)}
    assert "loaded" in refusal(loaded | {"power_w": 0.5 * 400.0 * columns["current_line_a"]})
    alike = {
        k: v[2] * np.linspace(0.95, 1.05, 9) if k != "frequency_hz" else np.full(9, 50.0) for k, v in columns.items()
    }
    assert "1.11 times the smallest" in refusal(
        alike | {"power_w": columns["power_w"][2] * np.linspace(0.95, 1.05, 9) ** 2}
    )


def test_copied_rows_make_nothing_surer():
    columns = locked(MOTORS[0], np.random.default_rng(4), 0.002, skin=0.15, saturation=0.12)
    once, several = named(columns)[0], named({k: np.repeat(v, 5) for k, v in columns.items()})[0]
    assert {n: c.sizes for n, c in once.items()} == {n: c.sizes for n, c in several.items()}
    assert "48 rows are copies" in read_points({k: np.repeat(v, 5) for k, v in columns.items()}, "x").remarks[0]


@pytest.mark.parametrize("motor", MOTORS, ids=lambda m: m.name)
def test_points_of_no_one_test_are_unexplained_and_nothing_is_named(motor):
    """Two motors in one table, both tests in one table, a running motor, numbers without a circuit."""
    random = np.random.default_rng(10)
    one = locked(motor, random, 0.003, saturation=0.1)
    other = locked(
        next(m for m in MOTORS if m.truth[2] > 1.5 * motor.truth[2] or m.truth[2] < motor.truth[2] / 1.5), random, 0.003
    )
    idle = no_load(motor, random, 0.003, saturation=0.5, growth=0.6)
    shaken = one | {"voltage_line_v": one["voltage_line_v"] * random.uniform(1.0, 2.0, 12)}
    for wrong in ({k: np.r_[one[k], other[k]] for k in one}, {k: np.r_[one[k], idle[k]] for k in one}, shaken):
        causes, seen = named(wrong)
        assert seen.verdict == "unexplained" and not causes and "more than one motor" in seen.reason
        assert headline(points_document(seen)) == "No circuit of the catalogue describes these points."


@pytest.mark.parametrize("motor", MOTORS, ids=lambda m: m.name)
def test_a_saturation_is_stated_over_the_range_that_was_measured(motor):
    """The straight line through a lowest flux at which the iron bends already is not known; the bend over the range is."""
    columns = {k: v[4:] for k, v in no_load(motor, np.random.default_rng(11), 0.003, saturation=0.5).items()}
    value, spread, _ = named(columns, "no_load")[0]["magnetizing_saturation"].sizes["extra_current_at_highest_flux"]
    lowest = (columns["voltage_line_v"].min() / columns["voltage_line_v"].max()) ** 7
    assert value == pytest.approx(1.5 / (1.0 + 0.5 * lowest) - 1.0, abs=max(3.0 * spread, 0.03)) and spread < 0.1


def test_the_page_draws_every_point_fitted_and_left_out():
    _, seen = named(locked(MOTORS[0], np.random.default_rng(4), 0.002, skin=0.15, saturation=0.12))
    document = points_document(seen)
    assert len(document["points"]) == 12
    before, after = (
        max(abs(p[f"current_error_{w}_left_out"]) for p in document["points"]) for w in ("before", "after")
    )
    assert after < 0.5 * before
    page = points_page(document, "table")
    assert "leakage saturation" in page.headline
    assert sum(isinstance(part, Picture) for section in page.sections for part in section.parts) == 1
