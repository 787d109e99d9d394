"""A drive file that says two things which cannot be together is refused by the key to correct."""

import copy
import math
import tomllib
from dataclasses import replace

import pytest

from commissioner.errors import ConfigurationError
from commissioner.link.files.drive_file import DRIVES_FOLDER, build, known_drives, load_profile
from commissioner.registers.contradictions import check_contradictions

DOCUMENTS = {name: tomllib.loads((DRIVES_FOLDER / f"{name}.toml").read_text("utf-8")) for name in known_drives()}


def changed(name, *changes):
    """A shipped drive's document with keys set: (path, value)."""
    document = copy.deepcopy(DOCUMENTS[name])
    for path, value in changes:
        *way, last = path.split(".")
        table = document
        for step in way:
            table = table.setdefault(step, {})
        table[last] = value
    return document


@pytest.mark.parametrize(
    ("drive", "path", "value", "key", "expected"),
    [
        ("simulated", "watchdog.min_ms", 3000, "watchdog.min_ms", "at most max_ms, which is 2000"),
        ("simulated", "identity.firmware_min", 0x20000, "identity.firmware_min", "at most firmware_max, which is 131071"),
        ("simulated", "limits.dc_link_min_v", 641.0, "limits.dc_link_min_v", "at most dc_link_max_v, which is 640"),
        ("simulated", "items.decimation.min", 101, "items.decimation.min", "at most max, which is 100"),
        ("abb_acs380", "status_bits.fault", 2, "status_bits.fault", "a bit of its own: status_bits.running is 2"),
        ("simulated", "interlock_bits.supply_ok", 0, "interlock_bits.supply_ok", "interlock_bits.sto_released is 0"),
        ("simulated", "window.flag_ended", 1, "window.flag_ended", "window.flag_running is 1"),
        ("simulated", "items.heartbeat.access", "r", "items.heartbeat.access", "the watchdog is fed by writing it"),
        ("simulated", "items.watchdog_ms.access", "r", "items.watchdog_ms.access", "armed by writing it"),
        ("simulated", "items.watchdog_ms.unit", "raw", "items.watchdog_ms.unit", "the watchdog's time"),
        ("simulated", "watchdog.fed_by", "hartbeat", "watchdog.fed_by", "items.NAME"),
        ("simulated", "items.rated_drive_current_a.unit", "V", "items.rated_drive_current_a.unit", "'A', as the name"),
        ("simulated", "items.shaft_speed_rad_per_s.unit", "s", "items.shaft_speed_rad_per_s.unit", "'rad/s'"),
        ("simulated", "items.bias_ramp_v_per_s.unit", "1/s", "items.bias_ramp_v_per_s.unit", "'V/s'"),
        ("simulated", "items.test_time_limit_s.unit", "ms", "items.test_time_limit_s.unit", "'s'"),
        ("simulated", "items.staged_rotor_resistance.unit", "H", "items.staged_rotor_resistance.unit", "'ohm' or '%'"),
        ("simulated", "items.power_factor.unit", "W", "items.power_factor.unit", "'%'"),
        ("simulated", "items.pole_pairs.unit", "A", "items.pole_pairs.unit", "no unit"),
        ("simulated", "items.rated_power_w.scale", 1e10, "items.rated_power_w.scale", "1e-09 ... 1e+09"),
        ("simulated", "items.staged_stator_resistance.scale", 10.0, "items.staged_stator_resistance.scale", "1, as items.stator_resistance"),
        ("simulated", "items.stored_leakage_inductance.scale", 1.0, "items.stored_leakage_inductance.scale", "0.001, as"),
        ("simulated", "items.rated_power_w.scale", 9e-10, "items.rated_power_w.scale", "1e-09 ... 1e+09"),
        ("yaskawa_a1000", "parameters.order", ["stator_resistance"] * 2, "parameters.order[1]", "parameters.order[0]"),
        ("yaskawa_a1000", "items.status_word.scale", 0.1, "items.status_word.scale", "read by its bits"),
        ("yaskawa_a1000", "items.fault_code.type", "f32", "items.fault_code.type", "a whole number's type"),
        ("yaskawa_a1000", "items.dc_link_v.type", "ascii", "items.dc_link_v.type", "a number's type"),
        ("danfoss_fc302", "items.rated_voltage_v.length", 2, "items.rated_voltage_v.length", "one number"),
        ("yaskawa_a1000", "items.status_word.access", "w", "items.status_word.access", "it is read"),
        ("yaskawa_a1000", "items.stator_resistance.access", "r", "parameters.order[0]", "can be written"),
        ("yaskawa_a1000", "parameters.enter", [[0x0312, 0]], "parameters.enter", "items.stator_resistance stands there"),
        ("danfoss_fc302", "store.writes", [[1300, 1]], "store.writes", "items.stator_resistance stands there"),
        ("yaskawa_a1000", "items.stator_resistance.convention", "percent_of_base_impedance", "items.stator_resistance.unit", "'%'"),
        ("yaskawa_a1000", "unknown.power_faktor", "not seen", "unknown.power_faktor", "perhaps power_factor"),
    ],
)  # fmt: skip
def test_what_contradicts_itself_is_refused_by_its_key(drive, path, value, key, expected):
    with pytest.raises(ConfigurationError) as caught:
        build(changed(drive, (path, value)), "some/drive.toml")
    error = caught.value
    assert (error.file, error.key, error.step) == ("some/drive.toml", key, "read configuration")
    assert expected in str(error.limit) and key in error.remedy


@pytest.mark.parametrize("scale", [0.0, math.nan, math.inf, -1.0])
def test_a_scale_that_is_no_scale_is_refused_in_a_profile_too(scale):
    profile = load_profile("simulated")
    item = replace(profile.item("rated_power_w"), scale=scale)
    with pytest.raises(ConfigurationError) as caught:
        check_contradictions(replace(profile, items={**profile.items, item.name: item}))
    assert caught.value.key == "items.rated_power_w.scale"


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("watchdog.min_ms", 2000),
        ("identity.firmware_max", 0x10000),
        ("items.rated_power_w.scale", 1e9),
        ("items.control_period_s.scale", 1e-9),
        ("items.dc_link_v.unit", "raw"),
        ("items.rated_drive_current_a.unit", ""),
        ("items.heartbeat.access", "w"),
        ("unknown.winding_degc_range", "its range was not seen"),
        ("unknown.write_functions", "not probed"),
        ("unknown.zzz", "a remark of its author"),
    ],
)
def test_what_is_on_the_limit_or_claims_nothing_is_taken(path, value):
    assert build(changed("simulated", (path, value)), "x.toml")


@pytest.mark.parametrize(("unit", "is_taken"), [("A", True), ("V", True), ("Hz", False)])
def test_a_last_letter_can_be_a_phases_where_a_word_says_the_unit(unit, is_taken):
    item = {"address": 900, "type": "u16", "access": "r", "unit": unit}
    document = changed("simulated", ("items.motor_current_v", item))
    if is_taken:
        assert build(document, "x.toml").item("motor_current_v").unit == unit
        return
    with pytest.raises(ConfigurationError) as caught:
        build(document, "x.toml")
    assert "'V' or 'A'" in str(caught.value.limit)


def test_a_heartbeat_is_written_only_where_the_drive_is_to_be_energised():
    watchdog = {"register": "t_ms", "min_ms": 1, "max_ms": 9, "fed_by": "beat", "action": "coast"}
    items = {
        "t_ms": {"address": 900, "type": "u16", "unit": "ms", "access": "rw", "source": "manual"},
        "beat": {"address": 902, "type": "u16", "access": "r", "source": "manual"},
    }
    document = changed("yaskawa_ga800", ("watchdog", watchdog), ("items", items))
    assert build(document, "x.toml").watchdog.fed_by == "beat"
    document["drive"]["capabilities"] = ["excite"]
    with pytest.raises(ConfigurationError) as caught:
        build(document, "x.toml")
    assert caught.value.key == "items.beat.access"


def test_what_is_written_in_per_cent_needs_the_drives_own_rated_values():
    """Where they are not read, nobody sees that the drive counts from another motor's."""
    percent = [
        ("items.stator_resistance.convention", "percent_of_base_impedance"), ("items.stator_resistance.unit", "%"),
        ("worked", [{
            "item": "stator_resistance", "words": [3334], "value": 3.334, "per_phase": 1.5399393, "source": "computed",
            "rated_voltage_v": 400.0, "rated_current_a": 5.0,
        }]),
    ]  # fmt: skip
    with pytest.raises(ConfigurationError, match="rated_voltage_v is missing") as caught:
        build(changed("yaskawa_a1000", *percent), "some/drive.toml")
    assert "means nothing without the drive's own" in str(caught.value.limit)
