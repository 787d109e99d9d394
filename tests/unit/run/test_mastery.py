"""Whose a claim in the drive is: another computer's, a process's of this one, or what a killed run left there."""

from contextlib import ExitStack
from dataclasses import dataclass, field
from types import SimpleNamespace

import pytest

from commissioner.errors import DriveInUse
from commissioner.link.drive.claim import Claimed
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.url import parse_url
from commissioner.run.holding.drive_lock import ACT, LOCKS, DriveLock
from commissioner.run.holding.mastery import Mastery

PROFILE = load_profile("simulated")
IDENTITY = SimpleNamespace(serial_number=1, drive_type="SIM")


@dataclass
class Register:
    """The claim of one drive, as it stands in its registers."""

    token: int = 0
    asked: list[str] = field(default_factory=list)

    def holder(self):
        return Claimed(self.token, "somebody@somewhere", 100) if self.token else None

    def take(self, token, _name):
        if self.token == 0:
            self.token = token
        return self.token == token

    def release(self):
        self.token = 0


@pytest.fixture(autouse=True)
def locks(monkeypatch, tmp_path):
    monkeypatch.setenv(LOCKS, str(tmp_path))


def lock(port: int) -> DriveLock:
    return DriveLock.take(parse_url(f"tcp://127.0.0.1:{port}?device=1"), PROFILE, ACT)


def master(register: Register, held: DriveLock) -> Mastery:
    return Mastery(SimpleNamespace(profile=PROFILE, claim=register), held)


def killed_at(port: int, register: Register) -> None:
    """A run that claims the drive and is gone: its lock is free, its record lies there, its claim stands."""
    with lock(port) as held:
        master(register, held).take(IDENTITY)


@pytest.mark.parametrize("drawn", [0, -1])
def test_what_a_killed_run_left_in_the_drive_is_taken_over_though_its_record_was_overwritten(monkeypatch, drawn):
    """Also where chance draws the same token once more, as it does for one of 254."""
    register = Register()
    monkeypatch.setattr("secrets.choice", lambda tokens: tokens[0])
    killed_at(502, register)
    left = register.token
    monkeypatch.setattr("secrets.choice", lambda tokens: tokens[drawn])
    with lock(502) as ours:
        master(register, ours).take(IDENTITY)
        assert register.token == ours.holder.token
        assert (register.token == left) is (drawn == 0)


def test_a_claim_of_another_computer_is_respected(monkeypatch, tmp_path):
    register = Register()
    monkeypatch.setenv(LOCKS, str(tmp_path / "of another computer"))
    killed_at(502, register)
    monkeypatch.setenv(LOCKS, str(tmp_path))
    with lock(502) as ours, pytest.raises(DriveInUse, match="on another computer"):
        master(register, ours).take(IDENTITY)


def test_a_process_of_this_computer_that_reached_the_drive_under_another_address_is_named():
    register = Register()
    with lock(502) as theirs, lock(503) as ours:
        master(register, theirs).take(IDENTITY)
        theirs.name_run("20260101-000000-simulated")
        with pytest.raises(DriveInUse, match="run 20260101-000000-simulated"):
            master(register, ours).take(IDENTITY)


def test_no_two_locks_of_this_computer_have_one_token():
    """Of 254: forty drawn blindly have a pair in 96 of 100, and whoever has a pair's token takes the other's drive for its own."""
    with ExitStack() as held:
        tokens = {held.enter_context(lock(port)).holder.token for port in range(600, 640)}
    assert len(tokens) == 40


def test_a_claim_that_happens_to_have_our_token_is_no_claim_of_ours():
    """It is a killed run's: seen as left, not as held, and taken anew."""
    register = Register()
    with lock(502) as ours:
        register.token = ours.holder.token
        run = master(register, ours)
        assert run.look()
        run.take(IDENTITY)
        assert register.token == ours.holder.token and not run.look()
