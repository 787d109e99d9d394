"""Motor parameters into the drive: put in use, look, store, look; the snapshot back where anything differs.

At every instant the set in use of a drive with staging is the old one or the new one. A drive without it takes the values
one by one; there the report of a failure names what it holds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import replace

from commissioner.errors import (
    CheckFailed,
    CommissionerError,
    DriveError,
    DriveFault,
    IdentityMismatch,
    WriteBackFailed,
)
from commissioner.link.drive.facts import Journal, WriteReport
from commissioner.link.drive.items import Items, number
from commissioner.link.drive.parameter_sets import ParameterSets, Values
from commissioner.link.drive.putting import Direct, Staged
from commissioner.link.drive.reading import NAMEPLATE_ITEMS, read_identity, read_status
from commissioner.records import DriveIdentity, ParameterSnapshot, WrittenParameter
from commissioner.registers.status import DriveState

SETTLE_POLL_S = 0.1
"""Between two looks at a drive that settles: shorter than any watchdog that is fed by reading."""


class WriteBack:
    """One write-back or restore on one drive."""

    def __init__(
        self, items: Items, journal: Journal, *, sleep: Callable[[float], None], clock: Callable[[], float]
    ) -> None:
        self._items, self._profile = items, items.profile
        self._sets = ParameterSets(items)
        self._sleep, self._clock = sleep, clock
        is_staged = items.profile.parameters is not None and items.profile.parameters.is_staged
        self._way = (
            Staged(self._sets, journal, sleep, clock) if is_staged else Direct(self._sets, journal, sleep, clock)
        )

    def snapshot(self) -> ParameterSnapshot:
        """What the drive holds once its jobs are done. `stored` is empty where the drive cannot show that set."""
        self._way.let_jobs_end()
        return ParameterSnapshot(
            identity=read_identity(self._items),
            in_use=self._sets.in_use(),
            stored=self._sets.stored(),
            store_count=self._sets.store_count(),
            plate=self._plate(),
        )

    def write(self, values: Values, snapshot: ParameterSnapshot, *, store: bool, always: bool = False) -> WriteReport:
        """`values` in use, and stored if asked; `always`: also where the drive has them in use already, by its own doing.
        Nothing is written where the drive is not as in the snapshot."""
        target = self._sets.complete(values, snapshot.in_use)
        check_can_be_given_back(snapshot)
        present = self._check_present(snapshot, snapshot.in_use, snapshot.stored)
        self._check_stopped()
        if store:
            self._check_endurance(present.store_count)
        try:
            self._bring(target, store=store, always=always)
            return self._report(target, present, is_stored=store and self._sets.can_store)
        except DriveError as error:
            raise self._after_failure(error, snapshot) from error

    def restore(self, snapshot: ParameterSnapshot, expected: Values | None, again: Collection[str] = ()) -> WriteReport:
        """The snapshot's sets in use and stored. WriteBackFailed where the drive does not hold them afterwards. `again`: what was just
        written otherwise, and which a drive that shows it late still shows as it was."""
        present = self._check_present(snapshot, expected, None)
        self._check_stopped()
        try:
            if again:
                self._way.put_again({name: snapshot.in_use[name] for name in again}, store=self._sets.can_store)
            is_stored = self._bring_back(snapshot)
            return self._report(snapshot.in_use, present, is_stored=is_stored)
        except DriveError as error:
            raise self._not_restored(error, present) from error

    def _check_present(
        self, snapshot: ParameterSnapshot, in_use: Values | None, stored: Values | None
    ) -> ParameterSnapshot:
        present = self.snapshot()
        theirs, ours = _key(present.identity), _key(snapshot.identity)
        if theirs != ours:
            raise _changed("the drive is not the one of the snapshot", theirs, ours)
        for name, value in snapshot.plate.items():
            if name in present.plate and not self._items.same_words(name, present.plate[name], value):
                raise _changed(f"{name} in the drive is not the one of the snapshot", present.plate[name], value)
        for wanted, held, which in ((in_use, present.in_use, "in use"), (stored, present.stored, "stored")):
            for name in wanted or {}:
                assert wanted is not None
                if name not in held or not self._items.same_words(name, held[name], wanted[name]):
                    raise _changed(f"{name} {which} is not the expected one", held.get(name), wanted[name])
        return present

    def _check_stopped(self) -> None:
        if "status_word" not in self._profile.items:
            return
        status = read_status(self._items)
        if status.is_energised:
            raise CheckFailed(
                "the drive's output is not blocked",
                step="write parameters",
                value=status.state,
                limit="a stopped drive",
                remedy="stop the motor first, at the drive or by its hard-wired stop",
            )
        if not status.interlocks.get("remote_control", True):
            raise CheckFailed(
                "the drive is under local control: it would not take what is written", step="write parameters",
                value="local", limit="bus control", remedy="switch the drive to remote (bus) control",
            )  # fmt: skip

    def _plate(self) -> dict[str, float]:
        """What stands in the drive about its motor, item by item: by this, too, one drive is told from another."""
        if self._profile.kind == "commissioning_map":
            return {}  # its serial number tells
        return {name: number(value) for name, value in self._items.read(NAMEPLATE_ITEMS).items()}

    def _fault(self) -> str:
        """What the drive reports; empty where nothing, or where its file knows no status."""
        if "status_word" not in self._profile.items:
            return ""
        status = read_status(self._items)
        return status.fault_text if status.fault_code or status.state == DriveState.FAULT.value else ""

    def _settle(self, before: str) -> None:
        """The drive's pause after a write, asking all the while: a drive whose watchdog we feed must not starve. DriveFault
        where it has tripped since the write; `before`: what it reported until then."""
        left = self._sets.group.settle_s
        while left > 0:
            self._sleep(min(left, SETTLE_POLL_S))
            left -= SETTLE_POLL_S
            if (now := self._fault()) and not before:
                break
            if "status_word" not in self._profile.items:
                self._sets.in_use()
        now = self._fault()
        if now and not before:
            raise DriveFault(
                f"the drive tripped after the parameters were written: {now}", step="settle", value=now, limit="no fault",
                remedy="remove the cause, reset the fault at the drive, then look at its parameters",
            )  # fmt: skip

    def _check_endurance(self, count: int | None) -> None:
        store = self._profile.store
        if count is not None and store and store.endurance_writes and count + 1 > store.endurance_writes:
            raise CheckFailed(
                "the drive's parameter memory is worn out",
                step="store",
                value=count,
                limit=f"{store.endurance_writes} writes",
                remedy="write without storing, or replace the drive's memory",
            )

    # --- act ----------------------------------------------------------------------------------------------------
    def _bring(self, target: Values, *, store: bool, always: bool = False) -> None:
        """`target` in use and, if asked, stored; verified; only what differs."""
        held = self._sets.in_use()
        has_changed = bool(self._sets.differing(target, held))
        if has_changed:
            before = self._fault()
            self._way.put_in_use(target, store=store)
            self._settle(before)
            self._sets.verify(target, self._sets.in_use(), "read back the values in use", before=held)
        is_unstored = (
            bool(self._sets.differing(target, self._sets.stored())) if self._sets.group.is_staged else has_changed
        )
        if store and is_unstored:
            self._way.put_in_memory(target)
        elif store and always:
            self._way.keep(target)
            self._sets.verify(target, self._sets.in_use(), "read back the values in use")

    def _bring_back(self, snapshot: ParameterSnapshot) -> bool:
        """Both sets of the snapshot; the stored one first where they differ, for a store takes what is in use. True
        where what is in use will outlast a power-off, as far as the drive file can tell."""
        has_to_store = bool(snapshot.stored) and bool(self._sets.differing(snapshot.stored, self._sets.stored()))
        if has_to_store:
            self._check_endurance(self._sets.store_count())
            self._bring(snapshot.stored, store=True)
        stores_while_writing = not self._sets.group.is_staged and self._sets.can_store
        self._bring(snapshot.in_use, store=stores_while_writing)
        return self._sets.group.is_staged or stores_while_writing

    # --- after --------------------------------------------------------------------------------------------------
    def _after_failure(self, error: DriveError, snapshot: ParameterSnapshot) -> WriteBackFailed:
        try:
            self._way.take_back(snapshot.in_use)
            self._way.let_jobs_end()
            self._bring_back(snapshot)
            fault = self._fault()
            outcome, was_restored = "the values held before this write are in the drive again, verified", True
            outcome += f"; the drive reports: {fault}" if fault else ""
        except CommissionerError as second:
            outcome, was_restored = f"the values held before this write could not be verified: {second.what}", False
        failed = WriteBackFailed(
            f"writing back failed: {error.what}; {outcome}",
            step=error.step,
            value=error.value,
            limit=error.limit,
            remedy=error.remedy if was_restored else "run restore before the drive is used",
        )
        failed.was_restored = was_restored
        return failed

    def _not_restored(self, error: DriveError, present: ParameterSnapshot) -> WriteBackFailed:
        """The failure, and whether the drive was seen to hold what it held before this restore."""
        try:
            is_as_found = self._is_as_found(present)
        except CommissionerError:
            is_as_found = False
        failed = WriteBackFailed(
            f"the snapshot could not be restored: {error.what}; the drive holds what it held before this restore, verified"
            if is_as_found else f"the snapshot could not be restored: {error.what}",
            step="restore", value=error.value, limit=error.limit, unit=error.unit,
            remedy=f"run restore again; {error.remedy}"
            if is_as_found else f"run restore again, until then the drive's parameters are not known; {error.remedy}",
        )  # fmt: skip
        failed.is_as_found = is_as_found
        return failed

    def _is_as_found(self, present: ParameterSnapshot) -> bool:
        """Both sets, once nothing that was asked for can still come: of values that were sent one by one, or a store, no look is a proof."""
        if not self._way.can_be_called_off:
            return False
        self._way.take_back(present.in_use)
        now = self.snapshot()
        return not self._sets.differing(present.in_use, now.in_use) and not (
            present.stored and self._sets.differing(present.stored, now.stored)
        )

    def _report(self, target: Values, before: ParameterSnapshot, *, is_stored: bool) -> WriteReport:
        after = self._sets.in_use()
        rows = tuple(
            WrittenParameter(
                name, self._profile.item(name).place, before.in_use[name],
                number(self._items.as_held(name, target[name])), after[name],
            )
            for name in self._sets.differing(target, before.in_use)
        )  # fmt: skip
        store = self._profile.store
        return WriteReport(
            written=rows,
            is_stored=is_stored,
            store_count_before=before.store_count,
            store_count_after=self._sets.store_count(),
            endurance_writes=store.endurance_writes if store else None,
            fault=self._fault(),
        )


def check_can_be_given_back(snapshot: ParameterSnapshot) -> None:
    """CheckFailed where the drive shows no number for a parameter: no archive could bring it back."""
    for name, value in snapshot.in_use.items():
        if not math.isfinite(value):
            raise CheckFailed(
                f"the drive shows no number as {name}: it could not be given back", step="look at what the drive holds",
                value="not a number", limit="a number", remedy="check the item's type, word order and address in the drive file; where the drive has "
                "no value yet, enter one at the keypad first",
            )  # fmt: skip


def _key(identity: DriveIdentity) -> DriveIdentity:
    """What must not change between snapshot and write: type, serial number, firmware, map."""
    return replace(identity, rated_drive_current_a=0.0, control_period_s=0.0, switching_frequency_hz=0.0)


def _changed(what: str, seen: object, wanted: object) -> IdentityMismatch:
    return IdentityMismatch(
        what,
        step="compare with the snapshot",
        value=seen,
        limit=wanted,
        remedy="someone or something changed the drive meanwhile; take a new snapshot by running again",
    )
