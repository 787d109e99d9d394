"""Drives whose parameters stand behind a mailbox, or are locked: checked, written, switched off and on, restored over TCP."""

import time
from contextlib import closing, contextmanager, suppress
from dataclasses import replace

import pytest

from commissioner.errors import IdentityMismatch, LinkError, RequestRefused, WriteBackFailed
from commissioner.link.drive.inverter import Inverter
from commissioner.link.drive.ordinary.mailbox import MailboxPort
from commissioner.link.drive.ordinary.unlocking import unlocked
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.modbus import open_port
from commissioner.link.wire.url import parse_url
from commissioner.motor.circuit import InverseGamma
from commissioner.operations.check import CheckRequest, check
from commissioner.settings import load_motor
from tests.support.vendor_process import MADE_UP, Vendor

PLATE = load_motor("motor_2kw2")
NEW = InverseGamma(3.7, 2.18, 0.0215, 0.307)
MAILBOX, LOCKED = MADE_UP


@contextmanager
def inverter(drive, name):
    profile = load_profile(name)
    with closing(open_port(parse_url(drive.url), profile)) as port:
        yield Inverter(port, profile)


@pytest.mark.parametrize("name", MADE_UP, ids=["mailbox", "unlock"])
def test_such_a_drive_is_checked_written_switched_off_and_on_and_restored(name):
    with Vendor(name, "--busy-s", "0.1") as drive:
        checked = check(CheckRequest(drive.url, name, "motor_2kw2"))
        with inverter(drive, name) as made_up:
            found = made_up.snapshot()
            report = made_up.write_circuit(NEW, PLATE, found)
            assert report.is_stored and {row.name for row in report.written} >= {"stator_resistance"}
            drive.press("off-on")
            held = made_up.snapshot().in_use
            assert held["stator_resistance"] == pytest.approx(3.7 if name == MAILBOX else 7.4, rel=1e-4)
            made_up.restore(found)
            assert made_up.snapshot().in_use == found.in_use
    assert checked.outcome == "passed"
    assert drive.truth["stored"]["stator_resistance"] == pytest.approx(found.in_use["stator_resistance"])


def test_a_written_parameter_is_named_by_its_number_and_its_plate_is_read_behind_the_mailbox():
    with Vendor(MAILBOX) as drive, inverter(drive, MAILBOX) as made_up:
        assert made_up.read_nameplate() == {"rated_voltage_v": 400.0, "rated_current_a": pytest.approx(5.0)}
        report = made_up.write_circuit(NEW, PLATE, made_up.snapshot())
    assert [row.register for row in report.written] == [1350, 1384]


def test_a_shipped_family_is_asked_through_its_mailbox_by_check():
    with Vendor("siemens_g120") as drive:
        done = check(CheckRequest(drive.url, "siemens_g120", "motor_2kw2"))
        with inverter(drive, "siemens_g120") as g120:
            assert g120.profile.items["ramp_down"].parameter == 1121
            assert "ramp_down" in g120._items.read(["ramp_down"])
    assert done.outcome == "passed"


def test_a_locked_drive_whose_file_knows_no_unlock_is_found_out_and_nothing_is_claimed():
    with Vendor(LOCKED) as drive, closing(open_port(parse_url(drive.url), load_profile(LOCKED))) as port:
        made_up = Inverter(port, replace(load_profile(LOCKED), unlock=None))
        with pytest.raises(WriteBackFailed):
            made_up.write_circuit(NEW, PLATE, made_up.snapshot())
    assert drive.truth["held"] == drive.truth["stored"]


def test_a_circuit_that_the_drive_computed_anew_after_a_new_plate_is_not_written_over_unseen():
    with Vendor(LOCKED) as drive, closing(open_port(parse_url(drive.url), load_profile(LOCKED))) as port:
        made_up = Inverter(port, load_profile(LOCKED))
        found = made_up.snapshot()
        with unlocked(port, load_profile(LOCKED)):
            port.write(9630, [600, 0])
        with pytest.raises(IdentityMismatch, match="rated_current_a in the drive is not the one of the snapshot"):
            made_up.restore(found)
        time.sleep(0.4)
        anew = made_up.snapshot()
        assert anew.in_use["stator_resistance"] != found.in_use["stator_resistance"]
        made_up.write_circuit(NEW, PLATE, anew)
    assert drive.truth["held"]["stator_resistance"] == pytest.approx(7.4, rel=1e-4)


def test_a_refusal_of_the_drives_own_meaning_is_not_answered_by_the_protocols_remedy():
    """Its exception 5 is a wrong password, and not a job that will end."""
    with Vendor(LOCKED) as drive, closing(open_port(parse_url(drive.url), load_profile(LOCKED))) as port:
        with pytest.raises(RequestRefused) as refused:
            port._refused("write register 1", 5, is_read=False)
        assert refused.value.remedy == "the drive says: the password is wrong"
        with pytest.raises(RequestRefused) as refused:
            port.write(9642, [1, 2])
    assert refused.value.value == 4
    assert "unlocked and under bus control" in refused.value.remedy


class Recorded:
    """A port that keeps what was written; after `fails_after` writes each one is refused."""

    read_retries, patience_s, reply_timeout_s, stats = 1, 0.0, 0.1, None

    def __init__(self, fails_after=99, answers=()):
        self.written, self.left, self.answers, self.asked = [], fails_after, list(answers), 0

    def write(self, address, values):
        if len(self.written) >= self.left:
            raise RequestRefused("no", step="write", value=4)
        self.written.append((address, list(values)))

    def read(self, address, count):
        self.asked += 1
        return self.answers[min(self.asked, len(self.answers)) - 1][:count]


def test_what_went_wrong_is_told_and_not_that_the_lock_failed_after_it():
    port = Recorded(fails_after=1)
    with pytest.raises(ValueError, match="isolate the supply"), unlocked(port, load_profile(LOCKED)):
        raise ValueError("isolate the supply")
    assert port.written == [(0x4001, [0x55AA])]
    with pytest.raises(LinkError), unlocked(Recorded(fails_after=1), load_profile(LOCKED)):
        pass
    port = Recorded()
    with suppress(ValueError), unlocked(port, load_profile(LOCKED)):
        raise ValueError
    assert port.written[-1] == (0x4001, [0])


def test_an_old_answer_in_the_mailbox_is_no_answer_and_the_question_is_put_once_more():
    profile = load_profile("siemens_g120")
    old, new = ((2, 0x2F0A, ref << 8 | 1, 0x0101, 0x0801, 0x4142, 0x6666) for ref in (9, 2))
    port = Recorded(answers=[old, (1, 0x2F00, 4, 0, 0, 0, 0), new])
    waited = []
    asked = MailboxPort(port, profile, profile.mailbox, waited.append, lambda: sum(waited))
    assert asked.read(profile.items["ramp_down"].address, 2) == (0x4142, 0x6666)
    assert len(port.written) == 2 and waited


def test_a_mailbox_that_stays_under_way_is_given_up_after_its_time():
    profile = load_profile("siemens_g120")
    port = Recorded(answers=[(1, 0x2F00, 4, 0, 0, 0, 0)])
    waited = []
    asked = MailboxPort(port, profile, profile.mailbox, waited.append, lambda: sum(waited))
    with pytest.raises(LinkError, match=r"no answer for parameter 1121\[0\]"):
        asked.write(profile.items["ramp_down"].address, (0x4142, 0x6666))
    assert len(port.written) == 1, "a write is never repeated"
