"""A drive file is taken whole or refused naming file, key, value and what would be right."""

import copy
import tomllib
from pathlib import Path

import pytest

from commissioner.errors import ConfigurationError, UsageError
from commissioner.link.files.drive_file import (
    DRIVES_FOLDER,
    archived_profile,
    build,
    known_drives,
    load_profile,
    reference,
)
from commissioner.settings import read_toml
from tests.support.vendor_process import MADE_UP

SIMULATED = tomllib.loads((DRIVES_FOLDER / "simulated.toml").read_text("utf-8"))
MISSING = object()
LOCKED = MADE_UP[1]


def changed(path, value):
    """The simulated drive's document with one key changed, added or taken out."""
    document = copy.deepcopy(SIMULATED)
    table = document
    *way, last = path.split(".")
    for step in way:
        table = table.setdefault(step, {})
    if value is MISSING:
        del table[last]
    else:
        table[last] = value
    return document


@pytest.mark.parametrize("name", known_drives())
def test_every_shipped_file_is_consistent(name):
    profile = load_profile(name)
    assert profile.name
    assert profile.file.endswith(f"{name}.toml")


def test_no_two_shipped_files_are_of_one_drive():
    """A file that was copied and kept the other's name would pass for it in every list."""
    names = [load_profile(name).name for name in known_drives()]
    assert len(set(names)) == len(names)


def test_the_map_is_read_as_it_is_written():
    profile = load_profile("simulated")
    assert len(profile.items) == len(SIMULATED["items"])
    for name, table in SIMULATED["items"].items():
        item = profile.item(name)
        assert (item.address, item.type, item.scale) == (table["address"], table["type"], table.get("scale", 1.0)), name
    assert profile.faults[6].startswith("watchdog expired")
    assert (profile.window.address, profile.window.words, profile.window.flags["ended"]) == (256, 125, 16)
    assert profile.identity.magic == 0x434D5352


def test_a_base_of_one_is_taken_off_every_address():
    document = {
        "drive": {"name": "x", "kind": "commercial", "capabilities": [], "status_decoder": "none"},
        "link": SIMULATED["link"] | {"address_base": 1},
        "items": {"dc_link_v": {"address": 0x6001, "type": "u16", "access": "r", "source": "manual"}},
    }
    assert build(document, "x.toml").item("dc_link_v").address == 0x6000


def test_a_base_of_one_is_taken_off_what_unlocks_enters_and_stores():
    """What stands bare in the file is printed in the same manual: one register beside it is another parameter."""
    document = read_toml(Path(LOCKED))
    document["link"]["address_base"] = 1
    document["items"]["stator_resistance"]["address"] += 1
    document["parameters"]["enter"] = [[0x0911, 0]]
    document["store"] = {"writes": [[8002, 1]], "done": [8002, 0], "coil": 65}
    profile = build(document, "x.toml")
    assert (profile.unlock.writes, profile.unlock.locks) == (((0x4000, 0x55AA),), ((0x4000, 0),))
    assert profile.parameters.enter == ((0x0910, 0),)
    assert (profile.store.writes, profile.store.done, profile.store.coil) == (((8001, 1),), (8001, 0), 64)


@pytest.mark.parametrize("key", ["unlock.writes", "unlock.locks", "parameters.enter", "store.writes", "store.done"])
def test_no_register_stands_before_the_first_one(key):
    document = read_toml(Path(LOCKED))
    document["link"]["address_base"] = 1
    document["items"]["stator_resistance"]["address"] += 1
    table, name = key.split(".")
    document[table][name] = [0, 1] if name == "done" else [[0, 1]]
    with pytest.raises(ConfigurationError, match="0 cannot be used") as refused:
        build(document, "x.toml")
    assert refused.value.key.startswith(key)


@pytest.mark.parametrize(
    ("key", "value", "shown_key", "expected"),
    [
        ("link.baud", 9600, "link.baud", "no such key; known here: "),
        ("items.echo.adress", 21, "items.echo.adress", "address"),
        ("speed", 1, "speed", "no such key"),
        ("drive.capabilities", ["fly"], "drive.capabilities.0", "'excite'"),
        ("drive.kind", "drive", "drive.kind", "'commissioning_map'"),
        ("drive.status_decoder", "cia", "drive.status_decoder", "'cia402'"),
        ("link", MISSING, "link", "needed"),
        ("link.device_id", "1", "link.device_id", "whole number"),
        ("link.device_id", 256, "link.device_id", "at most 255"),
        ("link.max_read_registers", 126, "link.max_read_registers", "at most 125"),
        ("link.word_order", "middle", "link.word_order", "'big'"),
        ("link.has_read_write_multiple", 1, "link.has_read_write_multiple", "true or false"),
        ("link.turnaround_s", float("nan"), "link.turnaround_s", "finite"),
        ("items.echo.type", "u8", "items.echo.type", "'u16'"),
        ("items.echo.address", -1, "items.echo.address", "0 or more"),
        ("items.echo.address", 70000, "items.echo.address", "at most 65535"),
        ("items.echo.scale", 0.0, "items.echo.scale", "above 0"),
        ("items.echo.convention", "per_fase", "items.echo.convention", "per_phase"),
        ("items.echo.address", 20, "items.echo.address", "at least 21: items.switching_frequency_hz reaches to 20"),
        ("items.echo.address", 300, "items.echo.address", "at least 381: window reaches to 380"),
        ("items.echo", MISSING, "items.echo", "a commissioning map needs it"),
        ("items.stored_rotor_resistance", MISSING, "items.stored_rotor_resistance", "a commissioning map needs it"),
        ("items.window_index.address", 40, "items.window_index.address", "35: one transaction writes both"),
        ("watchdog", MISSING, "watchdog", "a commissioning map needs it"),
        ("watchdog.register", "watchdog", "watchdog.register", "items.NAME"),
        ("window.data_registers", 118, "window.data_registers", "at most 117"),
        ("window.crc", "ccitt", "window.crc", "'modbus'"),
        ("window.header", ["session_id:u16"] * 7, "window.header", "crc16 last"),
        ("parameters.order", ["stator_resistance"], "parameters.order", "the four names"),
        ("parameters.staged_crc", MISSING, "parameters.staged_crc", "check sum"),
        ("commands.commit", MISSING, "commands.commit", "the word that starts the action"),
        ("interlock_bits.sto_released", 16, "interlock_bits.sto_released", "at most 15"),
        ("faults.seven", "x", "faults", "whole numbers"),
        ("unknown.echo", "nobody knows", "unknown.echo", "not both"),
    ],
)
def test_what_cannot_be_right_is_named_with_what_would_be(key, value, shown_key, expected):
    with pytest.raises(ConfigurationError) as caught:
        build(changed(key, value), "some/drive.toml")
    error = caught.value
    assert error.file == "some/drive.toml"
    assert error.key == shown_key
    assert expected in str(error.limit)
    assert error.exit_code == 2


def test_a_drive_with_bits_must_name_them():
    document = {
        "drive": {"name": "x", "kind": "commercial", "capabilities": [], "status_decoder": "bits"},
        "link": SIMULATED["link"],
        "items": {},
        "status_bits": {"running": 0, "fault": 3},
    }
    with pytest.raises(ConfigurationError) as caught:
        build(document, "x.toml")
    assert caught.value.key == "status_bits.ready"


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(UsageError) as caught:
        load_profile("danfos")
    assert "danfoss_fc302" in str(caught.value.limit)


def test_files_from_strangers_are_bounded_and_parsed_only(tmp_path):
    big = tmp_path / "big.toml"
    big.write_bytes(b"# " + b"x" * 2_000_000)
    broken = tmp_path / "broken.toml"
    broken.write_bytes(b"[drive\nname = \xff")
    for path in (big, broken):
        with pytest.raises(ConfigurationError):
            load_profile(path)
    with pytest.raises(UsageError):
        load_profile(tmp_path / "absent.toml")


@pytest.mark.parametrize("name", [n for n in known_drives() if n != "simulated"])
def test_what_no_vendor_source_tells_is_refused_with_the_reason(name):
    profile = load_profile(name)
    assert profile.kind == "commercial"
    for capability in ("excite", "stream"):
        with pytest.raises(UsageError) as caught:
            profile.require(capability)
        assert caught.value.remedy == profile.unknown[capability]
    with pytest.raises(UsageError) as caught:
        profile.item("magnetizing_inductance")
    assert len(caught.value.remedy) > 20


def test_danfoss_addresses_follow_the_vendors_formula():
    """Wire = 10 x parameter number - 1, FC 300 design guide: 1-30 -> 1299, 1-22 -> 1219, 16-30 -> 16299."""
    profile = load_profile("danfoss_fc302")
    parameters = {"stator_resistance": 130, "rated_voltage_v": 122, "dc_link_v": 1630, "pole_count": 139}
    assert {name: profile.item(name).address for name in parameters} == {n: 10 * p - 1 for n, p in parameters.items()}


def test_an_archive_names_a_packaged_file_without_saying_where_it_was_installed(tmp_path):
    assert reference(load_profile("simulated")) == "simulated"
    own = tmp_path / "mine.toml"
    own.write_bytes((DRIVES_FOLDER / "simulated.toml").read_bytes())
    assert reference(load_profile(own)) == str(own)


@pytest.mark.parametrize(
    "kept", ["simulated", "/gone/config/drives/simulated.toml", r"C:\gone\config\drives\simulated.toml"]
)
def test_an_older_archive_that_names_a_path_of_its_own_computer_is_read(kept):
    assert archived_profile(kept).identity == load_profile("simulated").identity


@pytest.mark.parametrize("kept", ["/gone/config/drives/nobody.toml", "/gone/simulated.toml"])
def test_another_file_that_is_gone_is_not_replaced(kept):
    with pytest.raises(UsageError):
        archived_profile(kept)
