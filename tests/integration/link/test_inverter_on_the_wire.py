"""The inverter against the simulated drive over TCP, RTU and TLS. Truth is the simulator's own log."""

import contextlib
import ssl

import numpy as np
import pytest
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec

from commissioner.errors import (
    CheckFailed,
    DriveError,
    DriveFault,
    IdentityMismatch,
    LinkError,
    LinkUnreachable,
    UsageError,
    WriteBackFailed,
)
from commissioner.link.drive.inverter import Inverter
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.modbus import open_port
from commissioner.link.wire.url import TcpUrl, parse_url
from sim.wire.faults import parse
from tests.campaigns.short_run import truth
from tests.support.raw_servers import Bank, TcpDevice
from tests.support.service.authority import Authority, private_pem
from tests.support.sim_process import SimProcess

PROFILE = load_profile("simulated")
REPLY_TIMEOUT_S = 0.25
WIRES = {"tcp": ("--tcp", "0"), "rtu": ("--rtu", "pty")}


@contextlib.contextmanager
def connect(sim, query=""):
    port = open_port(parse_url(sim.url + query), PROFILE, reply_timeout_s=REPLY_TIMEOUT_S)
    with contextlib.closing(port):
        yield Inverter(port, PROFILE)


def set_up(inverter, duration_s=0.5, **changes):
    inverter.set_watchdog(1000)
    inverter.set_limits(current_a=10.0, voltage_v=90.0, time_s=20.0)
    signal = {
        "axis_deg": 60.0,
        "tones": [(10.0, 5.0, 0.0), (5.0, 30.0, 1.0)],
        "bias_v": 4.0,
        "bias_ramp_v_per_s": 40.0,
        "scale": 0.5,
        "scale_ramp_per_s": 5.0,
        "duration_s": duration_s,
    }
    inverter.load_excitation(**signal | changes)


def stream(inverter, cursor):
    """Every block until the session ends."""
    blocks = []
    while True:
        window = inverter.fetch(cursor)
        cursor = window.cursor
        if window.block is not None:
            blocks.append(window.block)
        if window.has_ended:
            return blocks, cursor


def is_energised(log):
    """By the simulator's truth."""
    changes = [entry["event"] for entry in log if entry["event"] in ("energised", "de_energised")]
    return bool(changes) and changes[-1] == "energised"


@pytest.mark.parametrize("wire", WIRES)
def test_a_whole_session_comes_over_the_wire_without_a_hole(wire):
    with SimProcess(*WIRES[wire]) as sim, connect(sim) as inverter:
        inverter.identify()
        set_up(inverter)
        blocks, cursor = stream(inverter, inverter.enable())
        assert inverter.disarm().is_confirmed
        assert not is_energised(sim.log())
    indices = np.concatenate([block.first_index + np.arange(block.count) for block in blocks])
    np.testing.assert_array_equal(indices, np.arange(cursor.next_index))
    assert cursor.lost == 0
    assert cursor.next_index * blocks[0].sample_period_s == pytest.approx(0.5, abs=0.2)


def test_an_enabled_drive_has_heard_of_us_again_before_anything_else_is_asked_of_it():
    """Over a link of 150 ms a request the watchdog of 0.6 s ended the first session before its amplitude was set."""
    with SimProcess(*WIRES["tcp"]) as sim, connect(sim) as inverter:
        set_up(inverter)
        address = inverter.profile.item("heartbeat_echo").address
        before = inverter.port.read(address, 1)
        inverter.enable()
        after = inverter.port.read(address, 1)
        inverter.disarm()
    assert after != before


def test_the_same_session_is_the_same_samples_over_every_wire():
    """The wire must not touch a bit: same seed, same signal, TCP and RTU."""
    currents = []
    for arguments in WIRES.values():
        with SimProcess(*arguments, "--seed", "3") as sim, connect(sim) as inverter:
            set_up(inverter, duration_s=0.2)
            blocks, _ = stream(inverter, inverter.enable())
            currents.append(np.concatenate([block.current_u_a for block in blocks])[:900])
            inverter.disarm()
    np.testing.assert_array_equal(*currents)


@pytest.mark.parametrize("wire", WIRES)
def test_parameters_are_written_stored_and_restored_over_the_wire(wire):
    with SimProcess(*WIRES[wire]) as sim, connect(sim) as inverter:
        snapshot = inverter.snapshot()
        new = {"stator_resistance": 3.31, "magnetizing_inductance": 0.215}
        report = inverter.write_parameters(new, snapshot)
        after = inverter.snapshot()
        assert after.in_use == pytest.approx(dict(snapshot.in_use) | new, rel=1e-6)
        assert after.stored == after.in_use
        assert report.store_count_after == report.store_count_before + 1
        inverter.restore(snapshot, dict(after.in_use))
        assert inverter.snapshot().in_use == snapshot.in_use
        assert inverter.snapshot().stored == snapshot.stored


FAULTS = [
    "lost",
    "late:0.4",
    "repeated",
    "corrupted",
    "reordered",
    "stray_before",
    "lost_request",
    "truncated",
    "late:0.6",
    "short_reply",
    "stray_after",
    "wrong_unit",
    "stall:0.4",
    "wrong_function",
    "wrong_transaction",
]


def one_every(requests):
    """Each fault twice, one every so many requests: it meets another request of the sequence each time."""
    places = enumerate(FAULTS * 2, start=1)
    return [word for k, fault in places for word in ("--fault", f"{fault}@{requests * k}")]


@pytest.mark.parametrize("wire", WIRES)
def test_bad_answers_cost_a_session_no_sample_or_end_it_with_the_motor_dead(wire):
    whole = broken = 0
    with SimProcess(*WIRES[wire], "--seed", "5", *one_every(47)) as sim, connect(sim) as inverter:
        for _ in range(16):
            try:
                set_up(inverter, duration_s=0.25)
                blocks, cursor = stream(inverter, inverter.enable())
            except DriveError:
                broken += 1
            else:
                whole += 1
                indices = np.concatenate([block.first_index + np.arange(block.count) for block in blocks])
                np.testing.assert_array_equal(indices, np.arange(cursor.next_index))
                assert cursor.lost == 0
            assert inverter.disarm().is_confirmed
            assert not is_energised(sim.log())
        stats = inverter.port.stats
    assert stats.timeouts + stats.mismatches >= 8
    assert whole >= 4 and broken >= 1


TURNS, EVERY_WRITES = 24, 7


@pytest.mark.parametrize("wire", WIRES)
def test_bad_answers_while_writing_leave_old_or_new_and_we_know_which(wire):
    """Every seventh write meets a fault. A turn whose write was denied its answer is refused, and no turn is refused
    without a failure on the link: both by the simulator's log, on a busy host as on an idle one."""
    places = enumerate(FAULTS * 2, start=1)
    faults = [word for k, fault in places for word in ("--fault", f"{fault}@w{EVERY_WRITES * k}")]
    denied = written = refused = 0
    with SimProcess(*WIRES[wire], *faults) as sim, connect(sim) as inverter:
        inverter.port.read_retries = 2
        stats = inverter.port.stats
        for turn in range(TURNS):
            snapshot = again(inverter.snapshot)
            new = {"stator_resistance": 3.0 + 0.01 * turn, "magnetizing_inductance": 0.2 + 0.001 * turn}
            seen, failed = len(sim.log()), stats.timeouts + stats.mismatches
            refusal = None
            try:
                inverter.write_parameters(new, snapshot)
            except DriveError as error:
                refusal = error
            was_denied = any(denies(entry, wire) for entry in sim.log()[seen:])
            has_failed = stats.timeouts + stats.mismatches > failed
            assert refusal is not None or not was_denied
            assert refusal is None or has_failed
            if isinstance(refusal, WriteBackFailed) and not refusal.was_restored:
                again(lambda before=snapshot: inverter.restore(before))
            denied, written, refused = denied + was_denied, written + (refusal is None), refused + (refusal is not None)
            expected = dict(snapshot.in_use) | ({} if refusal else new)
            after = again(inverter.snapshot)
            assert after.in_use == pytest.approx(expected, rel=1e-6)
            assert after.stored == pytest.approx(expected, rel=1e-6)
        log = sim.log()
    assert [entry for entry in log if entry["event"] == "store"][-1]["stored"][0] == pytest.approx(
        after.stored["stator_resistance"], rel=1e-6
    )
    assert denied >= 8
    assert (written + refused, refused >= denied) == (TURNS, True)


def denies(entry, wire):
    """Whether this entry of the simulator's log is a fault of the wire that leaves a request without an answer."""
    if entry["event"] != "fault" or "request" not in entry:
        return False
    fault = parse(entry["name"] if entry["argument"] is None else f"{entry['name']}:{entry['argument']}")
    return truth.deny_the_answer([fault], wire, entry["function"], REPLY_TIMEOUT_S)


def again(ask, times=3):
    """As an operator would: once more after a link error."""
    for _ in range(times - 1):
        try:
            return ask()
        except DriveError:
            continue
    return ask()


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (("--scenario", "wrong_identity"), IdentityMismatch),
        (("--scenario", "wrong_firmware"), IdentityMismatch),
        (("--scenario", "watchdog_refused"), CheckFailed),
        (("--scenario", "sto_open"), CheckFailed),
        (("--scenario", "fault_present"), CheckFailed),
        (("--fault", "ignore:watchdog_ms"), DriveFault),
        (("--fault", "ignore:current_limit_a"), DriveFault),
        (("--fault", "ignore:mode"), DriveFault),
        (("--fault", "ignore:tones"), DriveFault),
        (("--fault", "ignore:control_word"), DriveFault),
        (("--fault", "refuse:watchdog_ms"), CheckFailed),
        (("--fault", "other_map"), CheckFailed),
    ],
)
def test_a_drive_that_must_not_be_energised_is_not(arguments, error):
    with SimProcess("--tcp", "0", *arguments) as sim, connect(sim) as inverter:
        with pytest.raises(error) as caught:
            inverter.identify()
            set_up(inverter)
            inverter.enable()
        inverter.disarm()
        assert "energised" not in [entry["event"] for entry in sim.log()]
    assert caught.value.step and caught.value.remedy


def test_a_trip_in_the_stream_ends_it_and_is_told_with_value_and_limit():
    with SimProcess("--tcp", "0", "--fault", "overcurrent@e0.1s") as sim, connect(sim) as inverter:
        set_up(inverter, duration_s=2.0)
        blocks, _ = stream(inverter, inverter.enable())
        status = inverter.read_status()
    assert blocks and (status.fault_text, status.is_energised) == ("over-current", False)
    assert abs(status.trip_value) > status.trip_limit


def test_lost_samples_are_counted_and_never_filled():
    with SimProcess("--tcp", "0", "--fault", "sample_gap:7@e0.1s") as sim, connect(sim) as inverter:
        set_up(inverter)
        blocks, cursor = stream(inverter, inverter.enable())
        inverter.disarm()
    assert cursor.lost == 7
    assert [block.lost_before for block in blocks if block.lost_before] == [7]
    assert sum(block.count for block in blocks) + 7 == cursor.next_index


def test_a_killed_service_leaves_a_dead_drive():
    """No disarm, no close: the watchdog alone."""
    import time

    with SimProcess("--tcp", "0") as sim, connect(sim) as inverter:
        inverter.set_watchdog(300)
        inverter.set_limits(current_a=10.0, voltage_v=90.0, time_s=20.0)
        set_up(inverter, duration_s=10.0)
        inverter.set_watchdog(300)
        inverter.enable()
        assert is_energised(sim.log())
        time.sleep(0.45)
        log = sim.log()
    assert not is_energised(log)
    assert log[-1]["event"] == "trip" and log[-1]["cause"] == 6


# --- TLS --------------------------------------------------------------------------------------------------
@pytest.fixture
def authority(tmp_path):
    return Authority(tmp_path, "test-ca")


def test_a_session_runs_over_tls_with_certificates_on_both_sides(authority):
    server, client = authority.issue("drive", ["127.0.0.1"]), authority.issue("service", [])
    arguments = ("--tls", "0", "--cert", str(server[0]), "--key", str(server[1]), "--ca", str(authority.file))
    with SimProcess(*arguments) as sim:
        with connect(sim, f"?ca={authority.file}&cert={client[0]}&key={client[1]}") as inverter:
            assert inverter.identify().drive_type == "SIM-INV-7A"
            set_up(inverter, duration_s=0.1)
            blocks, cursor = stream(inverter, inverter.enable())
            assert inverter.disarm().is_confirmed
        with pytest.raises(LinkError), connect(sim, f"?ca={authority.file}") as anonymous:
            anonymous.identify()
    assert sum(block.count for block in blocks) == cursor.next_index > 400


def context(cert, key):
    made = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    made.load_cert_chain(cert, key)
    return made


def test_a_server_with_a_certificate_for_another_name_is_refused(authority):
    server = context(*authority.issue("other", ["127.0.0.2"]))
    with TcpDevice(Bank(), server) as device, pytest.raises(LinkUnreachable) as caught:
        open_port(parse_url(f"tls://127.0.0.1:{device.port}?ca={authority.file}"), PROFILE)
    assert "127.0.0.1" in str(caught.value.value)


def test_a_server_that_nobody_we_trust_has_signed_is_refused(authority, tmp_path):
    server = context(*Authority(tmp_path, "stranger").issue("drive", ["127.0.0.1"]))
    with TcpDevice(Bank(), server) as device, pytest.raises(LinkUnreachable) as caught:
        open_port(parse_url(f"tls://127.0.0.1:{device.port}?ca={authority.file}"), PROFILE)
    assert "certificate verify failed" in str(caught.value.value)


def test_old_tls_is_refused(authority):
    old = context(*authority.issue("drive", ["127.0.0.1"]))
    old.set_ciphers("ALL:@SECLEVEL=0")
    with pytest.warns(DeprecationWarning):
        old.minimum_version = ssl.TLSVersion.TLSv1
        old.maximum_version = ssl.TLSVersion.TLSv1_1
    with TcpDevice(Bank(), old) as device, pytest.raises(LinkUnreachable):
        open_port(parse_url(f"tls://127.0.0.1:{device.port}?ca={authority.file}"), PROFILE)


def test_a_drive_that_speaks_plain_modbus_on_the_tls_port_is_refused_in_time(authority):
    with TcpDevice(Bank()) as device, pytest.raises(LinkUnreachable):
        url = parse_url(f"tls://127.0.0.1:{device.port}?ca={authority.file}")
        open_port(url, PROFILE, connect_timeout_s=0.5)


@pytest.mark.parametrize("which", ["ca", "cert", "key", "encrypted"])
def test_an_unusable_tls_file_is_a_usage_error_and_never_asks_for_a_password(authority, tmp_path, which):
    cert, key = authority.issue("service", [])
    files = {"ca": authority.file, "cert": cert, "key": key}
    if which == "encrypted":
        secret = serialization.BestAvailableEncryption(b"secret")
        key.write_bytes(private_pem(ec.generate_private_key(ec.SECP256R1()), secret))
    else:
        files[which] = tmp_path / "broken.pem"
        files[which].write_text("not a certificate")
    query = "&".join(f"{name}={path}" for name, path in files.items())
    with pytest.raises(UsageError) as caught:
        open_port(parse_url(f"tls://127.0.0.1:1?{query}"), PROFILE)
    assert "secret" not in str(caught.value.as_dict())


def test_a_closed_tcp_port_is_found_within_the_connect_time():
    with pytest.raises(LinkUnreachable):
        open_port(TcpUrl("127.0.0.1", 1), PROFILE, connect_timeout_s=0.5)
