"""Write-back and restore: old values or new values, verified, never a mixture that is not told."""

import struct
from dataclasses import replace

import pytest

from commissioner.errors import (
    CheckFailed,
    CommissionerError,
    IdentityMismatch,
    ReplyTimeout,
    UsageError,
    WriteBackFailed,
)
from commissioner.link.drive.facts import Action
from commissioner.link.drive.inverter import Inverter
from commissioner.link.files.drive_file import load_profile
from commissioner.motor.circuit import InverseGamma
from commissioner.settings import load_motor
from tests.support.scripted_port import PARAMETERS
from tests.unit.link.test_inverter import Bench as Wired

PROFILE = load_profile("simulated")
OLD = {"stator_resistance": 3.0, "rotor_resistance": 2.0, "leakage_inductance": 0.020, "magnetizing_inductance": 0.300}
NEW = {"stator_resistance": 3.3, "rotor_resistance": 1.9, "leakage_inductance": 0.024, "magnetizing_inductance": 0.310}


class Bench(Wired):
    def __init__(self) -> None:
        super().__init__()
        self.snapshot = self.inverter.snapshot()

    def held(self, prefix="") -> dict:
        scale = {name: 1e-3 if "inductance" in name else 1.0 for name in PARAMETERS}
        return {name: self.drive.get(prefix + name) * scale[name] for name in PARAMETERS}


@pytest.fixture
def bench():
    return Bench()


def test_new_values_are_in_use_and_stored_and_reported_with_what_was_before(bench):
    report = bench.inverter.write_parameters(NEW, bench.snapshot)
    assert bench.held() == pytest.approx(NEW, rel=1e-6)
    assert bench.held("stored_") == pytest.approx(NEW, rel=1e-6)
    row = {row.name: row for row in report.written}["leakage_inductance"]
    assert (row.register, row.before, row.after) == (580, 0.02, 0.024)
    assert row.read_back == pytest.approx(0.024, rel=1e-6)
    assert (report.is_stored, report.store_count_before, report.store_count_after) == (True, 17, 18)
    assert report.wear_fraction == pytest.approx(18 / 100000)


def test_only_what_differs_is_staged(bench):
    bench.inverter.write_parameters({**OLD, "rotor_resistance": 1.9}, bench.snapshot)
    staged = [name for name, _ in bench.drive.log if name.startswith("staged_") and name != "staged_crc"]
    assert staged == ["staged_rotor_resistance"]


def test_values_the_drive_has_already_cost_no_write_and_no_wear(bench):
    report = bench.inverter.write_parameters(OLD, bench.snapshot)
    assert report.written == () and report.store_count_after == 17
    assert bench.drive.log == [] and bench.journal == []


def test_without_store_the_memory_stays_as_it_was(bench):
    report = bench.inverter.write_parameters(NEW, bench.snapshot, store=False)
    assert bench.held() == pytest.approx(NEW, rel=1e-6)
    assert bench.held("stored_") == pytest.approx(OLD, rel=1e-6)
    assert (report.is_stored, report.store_count_after) == (False, 17)


def test_each_step_is_journalled_before_the_drive_hears_of_it(bench):
    bench.inverter.write_parameters(NEW, bench.snapshot)
    places = {action: at for action, _, at in bench.journal}
    names = [name for name, _ in bench.drive.log]
    assert places[Action.STAGE] <= names.index("staged_stator_resistance")
    assert places[Action.COMMIT] <= names.index("commit")
    assert places[Action.STORE] <= names.index("store")


def test_a_journal_that_cannot_write_stops_before_the_commit(bench):
    def full(intent):
        if intent.action is Action.COMMIT:
            raise OSError("no space left on device")

    bench.inverter.journal = full
    with pytest.raises(OSError, match="no space"):
        bench.inverter.write_parameters(NEW, bench.snapshot)
    assert bench.drive.written("commit") == []
    assert bench.held() == pytest.approx(OLD, rel=1e-6)


@pytest.mark.parametrize(
    ("item", "value"),
    [
        ("serial_number", 4712),
        ("firmware_version", 0x00010204),
        ("rotor_resistance", 2.1),
        ("stored_rotor_resistance", 2.1),
    ],
)
def test_a_drive_that_is_not_as_in_the_snapshot_is_not_written(bench, item, value):
    bench.drive.put(item, value)
    with pytest.raises(IdentityMismatch):
        bench.inverter.write_parameters(NEW, bench.snapshot)
    assert bench.drive.log == []


def test_a_drive_that_is_energised_is_not_written(bench):
    bench.drive.state = "enabled"
    with pytest.raises(CheckFailed, match="not blocked"):
        bench.inverter.write_parameters(NEW, bench.snapshot)
    assert bench.drive.log == []


def test_a_worn_out_memory_is_not_written(bench):
    bench.drive.put("store_count", 100000)
    with pytest.raises(CheckFailed, match="worn out"):
        bench.inverter.write_parameters(NEW, bench.snapshot)
    assert bench.drive.log == []


@pytest.mark.parametrize("values", [{"inertia": 1.0}, {"stator_resistance": float("nan")}, {"stator_resistance": 1e60}])
def test_values_that_are_no_parameters_of_the_drive_are_refused_before_the_wire(bench, values):
    with pytest.raises(UsageError):
        bench.inverter.write_parameters(values, bench.snapshot)
    assert bench.drive.log == []


# --- what goes wrong ----------------------------------------------------------------------------------------
@pytest.mark.parametrize("item", ["staged_stator_resistance", "staged_crc"])
def test_a_staged_value_that_did_not_arrive_is_found_before_the_commit(bench, item):
    bench.drive.deaf_to.add(item)
    with pytest.raises(WriteBackFailed) as caught:
        bench.inverter.write_parameters(NEW, bench.snapshot)
    assert bench.drive.written("commit") == []
    assert caught.value.was_restored
    assert bench.held() == pytest.approx(OLD, rel=1e-6)


@pytest.mark.parametrize("result", [0, 3, 4, 5])
def test_a_refused_commit_leaves_the_old_set_and_says_why(bench, result):
    bench.drive.commit_result = result
    with pytest.raises(WriteBackFailed, match="did not commit") as caught:
        bench.inverter.write_parameters(NEW, bench.snapshot)
    assert str(caught.value.value).endswith(f"({result})")
    assert caught.value.was_restored and "in the drive again, verified" in caught.value.what
    assert bench.held() == pytest.approx(OLD, rel=1e-6)


def test_a_commit_that_stays_busy_ends_within_the_deadline(bench):
    bench.drive.commit_result = 1
    with pytest.raises(WriteBackFailed, match="still busy"):
        bench.inverter.write_parameters(NEW, bench.snapshot)
    assert bench.now < 12.0


def test_a_commit_that_says_done_and_is_not_is_found_by_read_back(bench):
    bench.drive.put("commit_result", 2)
    bench.drive.deaf_to.add("commit")
    with pytest.raises(WriteBackFailed, match="instead of"):
        bench.inverter.write_parameters(NEW, bench.snapshot)
    assert bench.held() == pytest.approx(OLD, rel=1e-6)


def test_a_drive_that_changes_a_value_on_its_own_is_found_and_set_back(bench):
    original = bench.drive._commit

    def adapt(word):
        original(word)
        if bench.drive.get("magnetizing_inductance") > 305.0:
            bench.drive.put("rotor_resistance", 7.0)

    bench.drive._commit = adapt
    with pytest.raises(WriteBackFailed, match=r"rotor_resistance = 7\.0") as caught:
        bench.inverter.write_parameters(NEW, bench.snapshot)
    assert caught.value.was_restored
    assert bench.held() == pytest.approx(OLD, rel=1e-6)


def test_a_store_that_fails_brings_the_old_set_back_into_use(bench):
    bench.drive.store_result = 3
    with pytest.raises(WriteBackFailed, match="memory failed") as caught:
        bench.inverter.write_parameters(NEW, bench.snapshot)
    assert (caught.value.value, caught.value.limit) == ("the memory failed (3)", "done (2)")
    assert caught.value.was_restored
    assert bench.held() == bench.held("stored_") == pytest.approx(OLD, rel=1e-6)


def test_a_store_that_says_done_and_is_not_is_found_by_read_back(bench):
    bench.drive.put("store_result", 2)
    bench.drive.deaf_to.add("store")
    with pytest.raises(WriteBackFailed):
        bench.inverter.write_parameters(NEW, bench.snapshot)
    assert bench.held() == pytest.approx(OLD, rel=1e-6)


def lost(drive, request):
    drive.failures.clear()
    drive.failures.extend([None] * request)
    drive.failures.append(ReplyTimeout("no answer", step="test", value=None, limit=None, remedy="none"))


@pytest.mark.parametrize("fails_after_acting", [False, True], ids=["request lost", "answer lost"])
def test_one_loss_anywhere_leaves_old_or_new_and_the_report_is_true(fails_after_acting):
    endings = []
    for request_number in range(100):
        bench = Bench()
        bench.inverter.set_watchdog(500)
        bench.inverter.read_status()
        bench.drive.log.clear()
        bench.drive.fails_after_acting = fails_after_acting
        lost(bench.drive, request_number)
        try:
            bench.inverter.write_parameters(NEW, bench.snapshot)
        except WriteBackFailed as error:
            endings.append("failed")
            assert error.was_restored
            assert bench.held() == bench.held("stored_") == pytest.approx(OLD, rel=1e-6)
        except CommissionerError:
            endings.append("untouched")
            assert bench.drive.log == []
        else:
            endings.append("written")
            assert bench.held() == bench.held("stored_") == pytest.approx(NEW, rel=1e-6)
        if bench.drive.failures:
            break
        bench.inverter.read_status()  # names no other master
    assert len(endings) >= 20
    assert {"failed", "untouched", "written"} <= set(endings)


@pytest.mark.parametrize("request_number", range(0, 40, 3))
def test_a_link_that_dies_for_good_is_told_as_not_restored(bench, request_number):
    lost(bench.drive, request_number)
    bench.drive.failures.extend(list(bench.drive.failures)[-1:] * 200)
    try:
        bench.inverter.write_parameters(NEW, bench.snapshot)
    except WriteBackFailed as error:
        assert not error.was_restored and "restore" in error.remedy
    except CommissionerError:
        assert bench.drive.log == []
    assert bench.held() in (pytest.approx(OLD, rel=1e-6), pytest.approx(NEW, rel=1e-6))


def test_a_power_cycle_between_stage_and_commit_leaves_the_old_set(bench):
    def power_cycle(name, words):
        if name == "commit":
            bench.drive._power_up()
            bench.drive.on_write = lambda name, words: None

    bench.drive.on_write = power_cycle
    with pytest.raises(WriteBackFailed) as caught:
        bench.inverter.write_parameters(NEW, bench.snapshot)
    assert caught.value.was_restored
    assert bench.held() == pytest.approx(OLD, rel=1e-6)


# --- restore ------------------------------------------------------------------------------------------------
def test_restore_brings_every_word_of_the_snapshot_back(bench):
    before = list(bench.drive.words[576:584]), list(bench.drive.words[608:616])
    written = bench.inverter.write_parameters(NEW, bench.snapshot)
    expected = OLD | {row.name: row.after for row in written.written}
    report = bench.inverter.restore(bench.snapshot, expected)
    assert (list(bench.drive.words[576:584]), list(bench.drive.words[608:616])) == before
    assert report.is_stored and len(report.written) == 4


def test_a_snapshot_whose_sets_differed_comes_back_with_both(bench):
    bench.drive.put("rotor_resistance", 2.5)
    snapshot = bench.inverter.snapshot()
    bench.inverter.write_parameters(NEW, snapshot)
    bench.inverter.restore(snapshot)
    assert bench.held() == pytest.approx({**OLD, "rotor_resistance": 2.5}, rel=1e-6)
    assert bench.held("stored_") == pytest.approx(OLD, rel=1e-6)


def test_restoring_what_is_there_already_writes_nothing(bench):
    report = bench.inverter.restore(bench.snapshot)
    assert report.written == () and bench.drive.log == []


def test_restore_refuses_a_drive_that_someone_changed_since(bench):
    bench.inverter.write_parameters(NEW, bench.snapshot)
    bench.drive.put("rotor_resistance", 9.0)
    before = len(bench.drive.log)
    with pytest.raises(IdentityMismatch, match="rotor_resistance in use"):
        bench.inverter.restore(bench.snapshot, NEW)
    assert len(bench.drive.log) == before


def test_restore_refuses_another_drive(bench):
    bench.drive.put("serial_number", 1)
    with pytest.raises(IdentityMismatch):
        bench.inverter.restore(bench.snapshot)


def test_a_restore_that_cannot_be_verified_says_so(bench):
    bench.inverter.write_parameters(NEW, bench.snapshot)
    bench.drive.commit_result = 4
    with pytest.raises(WriteBackFailed, match="could not be restored") as caught:
        bench.inverter.restore(bench.snapshot)
    assert not caught.value.was_restored


@pytest.mark.parametrize(
    ("item", "result", "is_known"), [("commit_result", 4, True), ("commit_result", 1, True), ("store_result", 3, False)]
)
def test_a_restore_that_the_drive_refused_says_whether_what_it_held_was_seen_again(bench, item, result, is_known):
    """A store that may still be under way is proved by no look."""
    bench.inverter.write_parameters(NEW, bench.snapshot)
    setattr(bench.drive, item, result)
    with pytest.raises(WriteBackFailed, match="could not be restored") as caught:
        bench.inverter.restore(bench.snapshot)
    assert caught.value.is_as_found == is_known == ("are not known" not in caught.value.remedy)
    assert not is_known or bench.held() == bench.held("stored_") == pytest.approx(NEW, rel=1e-6)


def test_after_a_link_that_died_while_restoring_nothing_is_known(bench):
    bench.inverter.write_parameters(NEW, bench.snapshot)

    def dead(name, words):
        if name == "commit":
            bench.drive.failures.extend([ReplyTimeout("no answer", step="read", remedy="")] * 300)

    bench.drive.on_write = dead
    with pytest.raises(WriteBackFailed) as caught:
        bench.inverter.restore(bench.snapshot)
    assert not caught.value.is_as_found


# --- commercial drives --------------------------------------------------------------------------------------
class Registers:
    """A commercial drive: nothing but registers; parameters survive only while `is_storing`."""

    def __init__(self) -> None:
        from commissioner.link.wire.port import LinkStats

        self.words = [0] * 0x10000
        self.stats, self.read_retries, self.reply_timeout_s = LinkStats(), 0, 0.1
        self.log = []

    def read(self, address, count):
        return tuple(self.words[address : address + count])

    def write(self, address, values):
        self.log.append((address, list(values)))
        self.words[address : address + len(values)] = values

    def read_coil(self, address):
        return False

    def write_coil(self, address, value):
        self.log.append((address, value))

    def exchange(self, *_, **__):
        raise AssertionError("this drive has no FC23")

    def close(self):
        pass


def test_danfoss_takes_the_phase_resistance_in_tenths_of_milliohms_with_the_store_coil_first():
    drive = Registers()
    drive.words[50199] = 0x0202
    drive.words[1299:1301] = [0, 30000]
    inverter = Inverter(drive, load_profile("danfoss_fc302"), sleep=lambda s: None)
    snapshot = inverter.snapshot()
    assert snapshot.in_use == {"stator_resistance": pytest.approx(3.0)}
    report = inverter.write_parameters({"stator_resistance": 3.2}, snapshot)
    assert drive.log == [(64, True), (1299, [0, 32000]), (64, False)]
    assert report.is_stored and report.written[0].register == 1299


def test_yaskawa_is_stored_by_its_enter_register_once():
    drive = Registers()
    drive.words[0x20] = 0x0004
    drive.words[0x312] = 6000
    inverter = Inverter(drive, load_profile("yaskawa_a1000"), sleep=lambda s: None)
    snapshot = inverter.snapshot()
    inverter.write_parameters({"stator_resistance": 6.4}, snapshot)
    assert drive.log == [(0x312, [6400]), (0x0910, [0]), (0x0900, [0])]
    inverter.write_parameters({"stator_resistance": 6.4}, inverter.snapshot())
    assert len(drive.log) == 3


CIRCUIT, PLATE = InverseGamma(3.2, 2.1, 0.021, 0.23), load_motor("motor_2kw2")


@pytest.mark.parametrize(
    ("profile", "stopped", "register", "old", "words"),
    [
        ("danfoss_fc302", (50199, 0x0202), 1299, [0, 30000], [0, 32000]),  # per phase, 0.1 milliohm, 32 bits
        ("yaskawa_a1000", (0x20, 0x0004), 0x312, [6000], [6400]),  # line to line, milliohm
    ],
)
def test_an_identified_circuit_is_written_in_each_drives_own_terms(profile, stopped, register, old, words):
    drive = Registers()
    drive.words[stopped[0]] = stopped[1]
    drive.words[register : register + len(old)] = old
    inverter = Inverter(drive, load_profile(profile), sleep=lambda s: None)
    report = inverter.write_circuit(CIRCUIT, PLATE, inverter.snapshot())
    assert (register, words) in drive.log
    assert [row.name for row in report.written] == ["stator_resistance"]


def test_the_simulated_drive_takes_the_whole_circuit(bench):
    bench.inverter.write_circuit(CIRCUIT, PLATE, bench.snapshot)
    assert tuple(bench.held().values()) == pytest.approx(CIRCUIT.as_tuple(), rel=1e-6)


def test_altivar_is_restored_raw_and_says_that_it_is_not_stored():
    drive = Registers()
    drive.words[3201] = 0x0040
    for address, raw in ((9642, 11), (9652, 12), (9662, 13), (9667, 14)):
        drive.words[address] = raw
    inverter = Inverter(drive, load_profile("schneider_altivar"), sleep=lambda s: None)
    snapshot = inverter.snapshot()
    drive.words[9662] = 99
    report = inverter.restore(snapshot)
    assert drive.log == [(9662, [13])]
    assert not report.is_stored
    with pytest.raises(UsageError, match="cannot write back"):
        inverter.write_parameters({"stator_resistance": 12.0}, snapshot)


def test_a_running_commercial_drive_is_not_written():
    drive = Registers()
    drive.words[50199] = 0x0A02
    inverter = Inverter(drive, load_profile("danfoss_fc302"), sleep=lambda s: None)
    with pytest.raises(CheckFailed):
        inverter.write_parameters({"stator_resistance": 3.2}, inverter.snapshot())
    assert drive.log == []


def test_a_drive_without_known_parameters_has_an_empty_snapshot_and_is_refused_by_name():
    inverter = Inverter(Registers(), load_profile("hitachi_sj700"))
    assert inverter.snapshot().in_use == {}
    with pytest.raises(UsageError, match="cannot write back") as caught:
        inverter.write_parameters({}, inverter.snapshot())
    assert "keypad" in caught.value.remedy


@pytest.mark.parametrize("latches", [False, True], ids=["takes what is staged at its end", "took it at the command"])
def test_a_commit_still_at_work_when_its_answer_is_lost_does_not_end_behind_our_back(bench, latches):
    """Seen over the wire: the old set was read, called restored, and then the commit came true."""
    drive, finish, reads, taken = bench.drive, bench.drive._commit, [], []
    refresh = drive._refresh

    def begin(word):
        drive.put("commit_result", 1)
        reads.append(0)
        taken.extend(drive.words[592:601])
        raise ReplyTimeout("no answer", step="test", value=None, limit=None, remedy="none")

    def work():
        if reads and len(reads) < 12:
            reads.append(0)
            if len(reads) == 12:
                drive._commit = finish
                staged = list(drive.words[592:601])
                drive.words[592:601] = taken if latches else staged
                finish(0xC0DE)
                drive.words[592:601] = staged
        refresh()

    drive._commit, drive._refresh = begin, work
    with pytest.raises(WriteBackFailed) as caught:
        bench.inverter.write_parameters(NEW, bench.snapshot)
    assert caught.value.was_restored
    for _ in range(20):
        drive.read(576, 8)
    assert len(reads) == 12
    assert bench.held() == pytest.approx(OLD, rel=1e-6)


class Floats(Registers):
    """Its file allows more than 1 ohm; it answers NaN after the first write of `spoils` values."""

    def __init__(self, held, spoils=0):
        super().__init__()
        self.words[0x20], self.spoils = 0x0004, spoils
        self.words[0x312:0x314] = struct.unpack(">2H", struct.pack(">f", held))

    def write(self, address, values):
        super().write(address, values)
        if address == 0x312 and self.spoils:
            self.spoils -= 1
            self.words[0x312:0x314] = [0x7FC0, 0]


def with_floats():
    yaskawa = load_profile("yaskawa_a1000")
    item = replace(yaskawa.item("stator_resistance"), type="f32", scale=1.0, minimum=1.0)
    return replace(yaskawa, items={**yaskawa.items, item.name: item}, link=replace(yaskawa.link, max_write_registers=2))


def test_a_drive_that_reads_back_no_number_gets_back_what_it_held():
    drive = Floats(6.0, spoils=1)
    inverter = Inverter(drive, with_floats(), sleep=lambda s: None)
    with pytest.raises(WriteBackFailed, match=r"instead of 6\.5") as failed:
        inverter.write_parameters({"stator_resistance": 6.5}, inverter.snapshot())
    assert failed.value.was_restored
    assert inverter.snapshot().in_use == {"stator_resistance": 6.0}


def test_what_the_drive_held_outside_the_limits_of_its_file_is_given_back_and_a_new_value_is_not_taken():
    drive = Floats(0.5)
    inverter = Inverter(drive, with_floats(), sleep=lambda s: None)
    found = inverter.snapshot()
    inverter.write_parameters({"stator_resistance": 6.5}, found)
    inverter.restore(found)
    assert inverter.snapshot().in_use == {"stator_resistance": 0.5}
    with pytest.raises(UsageError, match="cannot hold"):
        inverter.write_parameters({"stator_resistance": 0.4}, found)


def test_what_no_archive_can_bring_back_is_not_written_over():
    drive = Floats(float("nan"))
    inverter = Inverter(drive, with_floats(), sleep=lambda s: None)
    with pytest.raises(CheckFailed, match="could not be given back"):
        inverter.write_parameters({"stator_resistance": 6.5}, inverter.snapshot())
    assert drive.log == []
