"""npm's modbus-serial at the other end, as a drive and as a master; it shares no Modbus code with us, pymodbus or libmodbus."""

import fcntl
import json
import os
import shutil
import subprocess
import tempfile
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from commissioner.link.drive.inverter import Inverter
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.modbus import open_port
from commissioner.link.wire.url import parse_url
from commissioner.motor.circuit import InverseGamma
from commissioner.settings import load_motor
from tests.conformance.test_independent_peers import null_modem
from tests.support.reference_firmware import FirmwareProcess
from tests.support.sim_process import SimProcess

PEERS = Path(__file__).resolve().parent / "peers"
VERSION = "8.0.25"
DANFOSS = {
    50199: 0x0202, 16299: 565, 1199: 0, 1200: 220, 1219: 400, 1229: 50, 1239: 0, 1240: 500, 1249: 1436, 1389: 4, 8029: 0,
    8030: 10, 1299: 0, 1300: 36000,
}  # fmt: skip


@pytest.fixture(scope="module")
def modules():
    """The folder of node's modules with modbus-serial in it, fetched once; skipped where that cannot be."""
    if not shutil.which("node") or not shutil.which("npm"):
        pytest.skip("no node or npm")
    folder = Path(tempfile.gettempdir()) / f"commissioner-modbus-serial-{os.getuid()}-{VERSION}"
    folder.mkdir(exist_ok=True)
    with (folder / "lock").open("w", encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / "node_modules" / "modbus-serial" / "package.json").is_file():
            command = ["npm", "install", "--no-audit", "--no-fund", "--prefix", str(folder), f"modbus-serial@{VERSION}"]
            done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=240)
            if done.returncode:
                pytest.skip(f"modbus-serial cannot be fetched: {done.stderr[-200:]}")
    return folder / "node_modules"


class NodeDrive(FirmwareProcess):
    """`drive.js` as a process; `truth` tells its registers afterwards."""

    def __init__(self, modules, where="tcp", delay_ms=0):
        registers = json.dumps({str(k): v for k, v in DANFOSS.items()})
        self._command = [
            "env",
            f"NODE_PATH={modules}",
            "node",
            str(PEERS / "drive.js"),
            where,
            registers,
            str(delay_ms),
        ]
        self.truth = {}


@contextmanager
def danfoss(url):
    with closing(open_port(parse_url(url), load_profile("danfoss_fc302"))) as port:
        yield Inverter(port, load_profile("danfoss_fc302"), sleep=lambda _: None)


def write_and_restore(inverter):
    found = inverter.snapshot()
    report = inverter.write_circuit(InverseGamma(3.7, 2.18, 0.0215, 0.307), load_motor("motor_2kw2"), found)
    assert [row.read_back for row in report.written] == [pytest.approx(3.7)]
    inverter.restore(found)
    assert inverter.snapshot().in_use == found.in_use


@pytest.mark.parametrize("delay_ms", [0, 15])
def test_a_drive_of_modbus_serial_is_read_written_and_restored_over_tcp(modules, delay_ms):
    with NodeDrive(modules, delay_ms=delay_ms) as drive, danfoss(drive.url + "?device=255") as inverter:
        assert inverter.read_nameplate()["rated_current_a"] == pytest.approx(5.0)
        write_and_restore(inverter)
    assert drive.truth["registers"]["1300"] == 36000
    assert drive.truth["coils"]["64"] is False


def test_a_drive_of_modbus_serial_is_read_written_and_restored_over_a_serial_line(modules):
    with (
        null_modem() as (theirs, ours),
        NodeDrive(modules, where=theirs) as drive,
        danfoss(f"rtu://{ours}?parity=N&stop=1&baud=115200") as inverter,
    ):
        write_and_restore(inverter)
    assert drive.truth["registers"]["1300"] == 36000


@pytest.mark.parametrize("wire", [("--tcp", "0"), ("--rtu", "pty", "--baud", "115200")], ids=["tcp", "rtu"])
def test_modbus_serial_reads_and_writes_our_simulator(modules, wire):
    with SimProcess("--scenario", "default", *wire) as sim:
        at = sim.url.rpartition(":")[2] if "--tcp" in wire else sim.url.partition("//")[2].partition("?")[0]
        command = ["node", str(PEERS / "master.js"), at, *(["115200"] if "--rtu" in wire else [])]
        environment = os.environ | {"NODE_PATH": str(modules)}
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60, env=environment)
    assert done.returncode == 0, done.stderr
    seen = json.loads(done.stdout)
    assert seen == {"magic": [0x434D, 0x5352], "one": [4711], "several": [815], "refusal": 2}
