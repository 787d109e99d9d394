"""A document's example proves an item in every convention: value, words and what they are per phase, by closed forms."""

import math
import tomllib

import pytest

from commissioner.errors import ConfigurationError
from commissioner.link.files.drive_file import DRIVES_FOLDER, build

RATED = {"rated_voltage_v": 400.0, "rated_current_a": 5.0, "rated_frequency_hz": 50.0}
BASE_OHM = 400 / math.sqrt(3) / 5
OMEGA = 2 * math.pi * 50


def drive_file(quantity, convention, unit, per_phase, **rated):
    """Danfoss' file, its one parameter another one, that holds 2.5 by the words 25000."""
    document = tomllib.loads((DRIVES_FOLDER / "danfoss_fc302.toml").read_text("utf-8"))
    document["items"]["stator_resistance"] |= {"quantity": quantity, "convention": convention, "unit": unit}
    document["worked"][0] |= {"words": [0, 25000], "value": 2.5, "per_phase": per_phase, **rated}
    return build(document, "changed.toml")


@pytest.mark.parametrize(
    ("quantity", "convention", "unit", "per_phase", "needs"),
    [
        ("rotor_resistance", "t_per_phase", "ohm", 2.5, ()),
        ("rotor_resistance", "gamma_line_to_line", "ohm", 1.25, ()),
        ("stator_resistance", "t_reactance_at_rated_frequency", "ohm", 2.5, ()),
        ("magnetizing_inductance", "t_reactance_at_rated_frequency", "ohm", 2.5 / OMEGA, ("rated_frequency_hz",)),
        ("rotor_resistance", "t_percent_of_base_impedance", "%", 0.025 * BASE_OHM, ("rated_voltage_v", "rated_current_a")),
        ("rotor_leakage_inductance", "t_percent_of_base_impedance", "%", 0.025 * BASE_OHM / OMEGA, tuple(RATED)),
        ("rotor_time_constant", "time_constant", "s", 2.5, ()),
    ],
)  # fmt: skip
def test_a_parameter_of_any_circuit_and_representation_can_be_proved(quantity, convention, unit, per_phase, needs):
    given = {name: RATED[name] for name in needs}
    assert drive_file(quantity, convention, unit, per_phase, **given).worked[0].per_phase == per_phase
    with pytest.raises(ConfigurationError, match=r"worked\[0\]\.per_phase"):
        drive_file(quantity, convention, unit, 1.01 * per_phase, **given)
    for name in needs:
        with pytest.raises(ConfigurationError) as refused:
            drive_file(quantity, convention, unit, per_phase, **{k: v for k, v in given.items() if k != name})
        assert name in refused.value.limit


def test_an_example_of_an_item_without_convention_says_nothing_per_phase():
    with pytest.raises(ConfigurationError) as refused:
        drive_file("", "", "raw", 2.5)
    assert (refused.value.value, refused.value.limit) == (2.5, "left out where the item has no convention")
