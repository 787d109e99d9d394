"""Peers that share no Modbus code with us: libmodbus behind the firmware on a serial line, mbpoll in front of our simulator."""

import os
import shutil
import subprocess
import threading
import tty
from contextlib import contextmanager

import pytest

from tests.support.command_line import call
from tests.support.reference_firmware import FirmwareProcess, build, needs_libmodbus
from tests.support.sim_process import SimProcess

needs_mbpoll = pytest.mark.skipif(shutil.which("mbpoll") is None, reason="no mbpoll")


@contextmanager
def null_modem():
    """Two serial devices, each the other's far end."""
    masters, slaves = zip(*(os.openpty() for _ in range(2)), strict=True)
    for descriptor in (*masters, *slaves):
        tty.setraw(descriptor)

    def carry(here, there):
        try:
            while data := os.read(here, 512):
                os.write(there, data)
        except OSError:
            return

    threads = [threading.Thread(target=carry, args=ends, daemon=True) for ends in (masters, masters[::-1])]
    for thread in threads:
        thread.start()
    try:
        yield tuple(os.ttyname(slave) for slave in slaves)
    finally:
        for descriptor in (*slaves, *masters):
            os.close(descriptor)


@pytest.fixture
def serial_drive():
    """URL of the firmware behind libmodbus at the other end of a serial line."""
    with null_modem() as (theirs, ours), FirmwareProcess(build(), line=("--rtu", theirs)):
        yield f"rtu://{ours}?parity=N&stop=1&baud=921600"


@needs_libmodbus
def test_check_passes_over_a_serial_line_against_libmodbus(serial_drive):
    answer = call("check", "--drive", serial_drive, "--motor", "motor_2kw2", "--json")
    assert answer.code == 0, answer.stdout[:2000]
    assert answer.json["drive"]["serial_number"] == 20260101


@needs_libmodbus
def test_the_kit_passes_over_a_serial_line_where_another_device_number_is_tried_too(serial_drive):
    answer = call("drives", "conformance", serial_drive, "--energise", "--yes", "--json")
    rules = {rule["name"]: rule for rule in answer.json["rules"]}
    assert [rule for rule in rules.values() if rule["outcome"] == "fail"] == []
    assert rules["other-devices-numbers-are-left-alone"]["outcome"] == "pass"
    assert answer.code == 0


@needs_mbpoll
def test_mbpoll_reads_and_writes_our_simulator():
    with SimProcess("--scenario", "default", "--tcp", "0") as sim:
        host, port = sim.url.removeprefix("tcp://").split(":")

        def mbpoll(*arguments):
            command = ["mbpoll", "-m", "tcp", "-p", port, "-a", "1", "-0", "-1", *arguments]
            return subprocess.run(command, capture_output=True, text=True, check=False, timeout=20)

        magic = mbpoll("-t", "4:hex", "-r", "0", "-c", "2", host)
        written = mbpoll("-t", "4", "-r", "21", host, "4711")
        echo = mbpoll("-t", "4", "-r", "21", "-c", "1", host)
        beyond = mbpoll("-t", "4", "-r", "5000", "-c", "1", host)
    assert magic.returncode == 0, magic.stdout + magic.stderr
    assert "0x434D" in magic.stdout
    assert "0x5352" in magic.stdout
    assert "Written 1 references" in written.stdout
    assert "4711" in echo.stdout
    assert "Illegal data address" in beyond.stdout + beyond.stderr
