"""The kit against two conforming firmwares of different authors, and against what is none."""

import pytest

from commissioner.conformance.records import Outcome
from commissioner.conformance.rules import RULES
from tests.support.command_line import call
from tests.support.reference_firmware import FirmwareProcess, build, make, missing, needs_libmodbus
from tests.support.service.described import judge as described
from tests.support.sim_process import SimProcess

NEEDS_A_HAND = {"watchdog-is-off-after-power-up", "hardware-faults-block-the-output", "clipped-samples-are-flagged"}
ON_A_SERIAL_LINE = "other-devices-numbers-are-left-alone"


def outcomes(document, outcome):
    return {rule["name"] for rule in document["rules"] if rule["outcome"] == outcome.value}


@pytest.fixture(params=["python", "c"])
def drive(request):
    """Both firmwares that implement the map, each in its own process."""
    if request.param == "c":
        if missing():
            pytest.skip(missing())
        process = FirmwareProcess(build())
    else:
        process = SimProcess("--scenario", "default", "--tcp", "0", "--seed", "1")
    with process as running:
        yield running


def test_a_conforming_firmware_passes_every_rule_that_can_be_tried(drive):
    answer = call("drives", "conformance", drive.url, "--energise", "--yes", "--json")
    assert answer.code == 0, answer.stdout[:2000]
    document = answer.json
    described("conformance", document)
    assert document["outcome"] == "passed"
    assert len(document["rules"]) == len(RULES)
    assert outcomes(document, Outcome.NOT_TESTED) == NEEDS_A_HAND | {ON_A_SERIAL_LINE}
    assert outcomes(document, Outcome.FAIL) == set()


def test_nothing_is_energised_unless_told(drive):
    answer = call("drives", "conformance", drive.url, "--json")
    assert answer.code == 0
    energising = {rule["name"] for rule in answer.json["rules"] if rule["energises"]}
    assert energising <= outcomes(answer.json, Outcome.NOT_TESTED)
    assert all(rule["requests"] == 0 for rule in answer.json["rules"] if rule["energises"])
    assert answer.json["energised"] is False


def test_what_waits_for_a_voltage_is_told_once_and_with_all_each_by_name():
    """44 rules said the same sentence, and what was found lay above three screens of it."""
    with SimProcess("--scenario", "default", "--tcp", "0") as sim:
        told = call("drives", "conformance", sim.url, "--all").stdout
    assert told.count("give --energise") == 1
    assert {rule.name for rule in RULES} <= set(told.replace(",", " ").split())


def test_every_rule_that_was_tried_shows_requests_replies_and_times():
    with SimProcess("--scenario", "default", "--tcp", "0") as sim:
        document = call("drives", "conformance", sim.url, "--json").json
    for rule in document["rules"]:
        if rule["outcome"] == "pass":
            assert rule["requests"] > 0
            assert rule["evidence"][-1]["request"], rule["name"]
            assert rule["evidence"][-1]["took_s"] > 0


def test_a_drive_of_another_identity_fails_by_name_with_exit_code_3():
    with SimProcess("--scenario", "wrong_identity", "--tcp", "0") as sim:
        answer = call("drives", "conformance", sim.url, "--energise", "--yes", "--json")
    assert answer.code == 3
    assert outcomes(answer.json, Outcome.FAIL) == {"magic-and-map-version"}
    assert all(rule["requests"] == 0 for rule in answer.json["rules"][1:])


def test_nothing_is_written_into_a_device_that_is_none_of_ours():
    """The kit wrote 1, 1 over the first registers of whatever answered, as its rule of read-only items."""
    with SimProcess("--scenario", "wrong_identity", "--tcp", "0") as sim:
        answer = call("drives", "conformance", sim.url, "--rule", "read-only-items-stay", "--json")
    tried = {rule["name"]: rule["requests"] > 0 for rule in answer.json["rules"]}
    assert answer.code == 3 and tried == {"magic-and-map-version": True, "read-only-items-stay": False}


def test_an_open_interlock_keeps_every_energising_rule_untried():
    with SimProcess("--scenario", "sto_open", "--tcp", "0") as sim:
        answer = call("drives", "conformance", sim.url, "--energise", "--yes", "--json")
    tried = [rule["name"] for rule in answer.json["rules"] if rule["energises"] and rule["requests"]]
    assert tried == []


def test_nobody_there_is_exit_code_5_and_a_commercial_drive_file_is_2():
    assert call("drives", "conformance", "tcp://127.0.0.1:9", "--json").code == 5
    assert call("drives", "conformance", "tcp://127.0.0.1:9", "--profile", "siemens_v20", "--json").code == 2
    assert call("drives", "conformance", "tcp://127.0.0.1:9", "--rule", "no-such-rule", "--json").code == 2
    assert call("drives", "conformance", "tcp://127.0.0.1:9", "--energise", "--json").code == 2


@needs_libmodbus
def test_the_firmwares_own_tests_pass_and_its_fuzzer_finds_nothing_with_the_sanitizers_on():
    said = make("check", "SECONDS=2")
    assert ", 0 failed" in said
    assert "nothing failed" in said


@needs_libmodbus
def test_the_firmwares_item_table_is_the_drive_files():
    import subprocess

    from commissioner.link.files.drive_file import load_profile

    lines = subprocess.run([str(build()), "--map"], capture_output=True, text=True, check=True, timeout=10).stdout
    table = {int(row[0]): row[1:] for row in (line.split() for line in lines.splitlines())}
    profile = load_profile("simulated")
    assert table.pop(profile.window.address)[0] == "window"
    items = {item.address: item for item in profile.items.values()}
    assert set(table) == set(items)
    for address, (kind, length, flags) in table.items():
        item = items[address]
        assert (kind, int(length)) == (item.type, item.length), item.name
        assert bool(int(flags) & 1) == ("w" in item.access), item.name
        assert bool(int(flags) & 2) == item.needs_stop, item.name
