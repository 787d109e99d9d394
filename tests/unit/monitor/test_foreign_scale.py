"""Currents of a foreign scale: nothing is crossed, it is the scale that is refused. Phasors are the circuit's own."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from commissioner.monitor.chain import Refused, observe
from commissioner.monitor.intake.against_plate import RESOLVED, against_plate, unresolved_shaft, unscaled_order_deg
from commissioner.monitor.intake.channels import THIRD, Pairing, pair
from commissioner.monitor.intake.findings import Audited, Finding, Fundamental
from commissioner.motor.plate_match import OperatingPoint, contradiction, plate_point
from commissioner.motor.running import from_nameplate, stator_impedance
from tests.support.running import rewired, taken, taken_with
from tests.unit.monitor.test_pairing_by_slip import LIGHT

PLATE = taken("running_compressor", 1, 8.0)[1]
CROSSED = Finding("crossed_channels", "corrected", "")
VOLTS = PLATE.rated_voltage_v * math.sqrt(2.0 / 3.0)


def paired(scale: float, load: float, turned: int = 0) -> Pairing:
    """At a share of rated slip; `turned`: the current columns named so many phases on."""
    impedance = stator_impedance(from_nameplate(PLATE), PLATE.rated_frequency_rad_per_s, load * PLATE.rated_slip)
    volts = [VOLTS * np.exp(-1j * THIRD * k) for k in range(3)]
    amperes = [scale * volts[(k + turned) % 3] / impedance for k in range(3)]
    return pair(amperes, volts, PLATE, from_nameplate(PLATE), PLATE.rated_frequency_hz, False)


@pytest.mark.parametrize("load", [0.05, 0.3, 0.8, 1.2])
@pytest.mark.parametrize("scale", [0.001, 0.01, 0.08, 1.0, 10.0, 1000.0])
def test_straight_columns_are_straight_at_any_scale(scale: float, load: float) -> None:
    found = paired(scale, load)
    assert found.findings == () and found.current_order == (0, 1, 2)


@pytest.mark.parametrize(("scale", "load"), [(1 / 3, 1.2), (0.4, 1.4), (0.5, 1.2)])
def test_a_part_of_an_overloads_current_is_no_crossed_generators(scale: float, load: float) -> None:
    """As large as an idling machine's, it had been taken as of three inverted and crossed channels: -1.7 N m where 18.3 were, without a doubt."""
    found = paired(scale, load)
    assert found.current_order == (0, 1, 2) and found.current_sign == (1, 1, 1)
    assert "crossed_channels" not in {f.code for f in found.findings} and not found.is_refused


@pytest.mark.parametrize("load", [0.8, 1.2])
@pytest.mark.parametrize("scale", [0.01, 1.0, 100.0])
def test_crossed_columns_are_crossed_at_any_scale(scale: float, load: float) -> None:
    assert [f.code for f in paired(scale, load, turned=1).findings] == ["crossed_channels"]


@pytest.mark.parametrize("scale", [0.02, 0.001])
def test_a_small_current_is_refused_for_its_size(scale: float) -> None:
    recording = taken("running_compressor", 1, 8.0)[0]
    small = replace(recording, currents_a=tuple(scale * x for x in recording.currents_a))
    seen = observe(small, PLATE)
    assert isinstance(seen, Refused) and seen.reason.code == "current_level"
    assert "crossed_channels" not in {f.code for f in seen.findings}


def audited(scale: float, load: float, lag_deg: float) -> tuple[Audited, float, float]:
    """As another order reads it, with the shaft's frequency and the lag of the order that is named."""
    slip = load * PLATE.rated_slip
    drawn = plate_point(PLATE, OperatingPoint(VOLTS / math.sqrt(2.0), PLATE.rated_frequency_hz, slip, 0.0, 0.0, 0.0))
    named = math.degrees(math.atan2(drawn.reactive_var, drawn.power_w))
    power = scale * complex(drawn.power_w, drawn.reactive_var) * np.exp(1j * math.radians(lag_deg - named))
    mains = Fundamental(
        PLATE.rated_frequency_hz, complex(VOLTS), complex(scale * drawn.current_a * math.sqrt(2.0)), 0j, 0j, power.real,
        power.imag, False,
    )  # fmt: skip
    none = np.zeros(0, dtype=np.complex128)
    seen = Audited(0, 0.0, 1e-3, none, none, None, mains, (CROSSED,), {}, lag_deg=lag_deg, others_deg=(named,))
    return seen, (1.0 - slip) * PLATE.rated_frequency_hz / PLATE.pole_pairs, named


@pytest.mark.parametrize("scale", [2.0, 3.0])
def test_doubled_currents_of_an_idling_motor_are_read_as_they_are_named(scale: float) -> None:
    """As large as at load, they had been taken as crossed, and 2.87 had stood beside a current 1.83 times the plate's."""
    seen, shaft_hz, named = audited(scale, 0.05, 25.0)
    assert named > 75.0
    assert unscaled_order_deg(seen, shaft_hz, PLATE) == pytest.approx(named)
    assert unscaled_order_deg(replace(seen, findings=()), shaft_hz, PLATE) is None


def test_an_order_that_one_factor_explains_stands() -> None:
    seen, shaft_hz, named = audited(2.0, 0.05, 25.0)
    mains = seen.fundamental
    assert mains is not None
    apparent = abs(complex(mains.power_w, mains.reactive_var)) * np.exp(1j * math.radians(named))
    right = replace(
        seen,
        others_deg=(25.0,),
        lag_deg=named,
        fundamental=replace(mains, power_w=apparent.real, reactive_var=apparent.imag),
    )
    assert unscaled_order_deg(right, shaft_hz, PLATE) is None


def test_numbers_that_differ_are_said_each() -> None:
    slip = 0.5 * PLATE.rated_slip
    said = plate_point(PLATE, OperatingPoint(VOLTS / math.sqrt(2.0), PLATE.rated_frequency_hz, slip, 0.0, 0.0, 0.0))
    seen = replace(
        said, current_a=2.0 * said.current_a, power_w=3.0 * said.power_w, reactive_var=4.0 * said.reactive_var
    )
    found = contradiction(seen, PLATE)
    assert found is not None
    assert (
        "2 times the plate's current, 3 times its active and 4 times its reactive power, 2.88 times in the"
        in found.what
    )


@pytest.mark.parametrize(("order", "is_crossed"), [((0, 1, 2, 3, 4, 5), False), ((1, 0, 2, 3, 4, 5), True)])
def test_the_factor_of_a_lightly_loaded_motor_is_that_of_its_currents(order: tuple[int, ...], is_crossed: bool) -> None:
    recording, plate, _ = taken_with("running_compressor", 1, 8.0, LIGHT)
    doubled = rewired(replace(recording, currents_a=tuple(2.0 * x for x in recording.currents_a)), order)
    seen = observe(doubled, plate)
    assert isinstance(seen, Refused) and seen.reason.code == "plate_contradiction"
    assert "2.02 times in the geometric mean (a probe, a turns or a terminal factor?)" in seen.reason.what
    assert ("crossed_channels" in {f.code for f in seen.findings}) == is_crossed


def test_power_against_the_slip_is_no_machine_of_the_plate_and_a_generator_is() -> None:
    """Channels taken as crossed, of currents twice as large: driven above its speed by the slip, and taking power."""
    at = OperatingPoint(VOLTS / math.sqrt(2.0), PLATE.rated_frequency_hz, -0.13, 0.0, 0.0, 0.0)
    generator = plate_point(PLATE, at)
    found = contradiction(replace(generator, power_w=PLATE.rated_power_w), PLATE)
    assert found is not None and "gives back" in found.what and f"{-generator.power_w:.4g} W" in found.what
    assert contradiction(generator, PLATE) is None
    idling = plate_point(PLATE, replace(at, slip=-0.01 * PLATE.rated_slip))
    assert contradiction(replace(idling, power_w=0.1 * PLATE.rated_power_w), PLATE) is None


def test_a_slip_that_the_length_does_not_resolve_accuses_no_scale() -> None:
    """110 and 200 kW motors at a tenth of their load were refused as of half the plate's current: 0.15 periods off, in the shaft's line."""
    _, shaft_hz, named = audited(1.0, 0.1, 0.0)
    right = audited(1.0, 0.1, named)[0]
    pulled_hz = shaft_hz - 0.3
    assert against_plate(right, pulled_hz, PLATE) is not None
    blurred = unresolved_shaft(right, pulled_hz, 0.9 * RESOLVED / 0.3, PLATE)
    assert blurred is not None and blurred.code == "no_shaft_line" and f"{shaft_hz:.3f}"[:5] in blurred.what
    assert unresolved_shaft(right, pulled_hz, 1.1 * RESOLVED / 0.3, PLATE) is None


@pytest.mark.parametrize("scale", [0.5, 2.0])
@pytest.mark.parametrize("load", [0.1, 0.7])
def test_a_foreign_scale_stays_one_however_short_the_recording(scale: float, load: float) -> None:
    _, shaft_hz, named = audited(scale, load, 0.0)
    right = audited(scale, load, named)[0]
    assert against_plate(right, shaft_hz, PLATE) is not None
    assert unresolved_shaft(right, shaft_hz, 0.01, PLATE) is None
