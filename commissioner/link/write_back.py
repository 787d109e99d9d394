"""Motor parameters into the drive: stage, look, commit, look, store, look; the snapshot back where anything differs.

At every instant the drive's set in use is the old one or the new one: staged values take effect by one commit with a
check sum. A drive without staging takes the values one by one; there the report of a failure names what it holds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from commissioner.errors import (
    CheckFailed,
    CommissionerError,
    DriveError,
    DriveFault,
    IdentityMismatch,
    UsageError,
    WriteBackFailed,
)
from commissioner.link.facts import Action, Intent, Journal, WriteReport
from commissioner.link.items import Items, number
from commissioner.link.reading import read_identity, read_status
from commissioner.records import DriveIdentity, ParameterSnapshot, WrittenParameter
from commissioner.registers.codec import Value, crc16_modbus, encode_item
from commissioner.registers.profile import ParameterGroup, Store

Values = Mapping[str, float]

BUSY, DONE = 1, 2
RESULT_DEADLINE_S = 5.0
POLL_S = 0.01
COMMIT_RESULTS = {
    0: "nothing happened", 1: "still busy", 3: "check sum wrong", 4: "value out of the drive's range", 5: "not stopped"
}
STORE_RESULTS = {0: "nothing happened", 1: "still busy", 3: "the memory failed", 5: "not stopped"}


class WriteBack:
    """One write-back or restore on one drive."""

    def __init__(
        self, items: Items, journal: Journal, *, sleep: Callable[[float], None], clock: Callable[[], float]
    ) -> None:
        self._items = items
        self._profile = items.profile
        self._journal = journal
        self._sleep, self._clock = sleep, clock
        self._has_asked_to_commit = False

    def snapshot(self) -> ParameterSnapshot:
        """What the drive holds once its jobs are done. `stored` is empty where the drive cannot show that set."""
        self._let_jobs_end()
        return ParameterSnapshot(
            identity=read_identity(self._items),
            in_use=self._read_in_use(),
            stored=self._read_stored(),
            store_count=self._store_count(),
        )

    def write(self, values: Values, snapshot: ParameterSnapshot, *, store: bool) -> WriteReport:
        """`values` in use, and stored if asked. Nothing is written where the drive is not as in the snapshot."""
        target = self._complete(values, snapshot)
        present = self._check_present(snapshot, snapshot.in_use, snapshot.stored)
        self._check_stopped()
        if store:
            self._check_endurance(present.store_count, writes=1)
        try:
            self._bring(target, store=store)
            return self._report(target, present, is_stored=store and self._can_store())
        except DriveError as error:
            raise self._after_failure(error, snapshot) from error

    def restore(self, snapshot: ParameterSnapshot, expected: Values | None) -> WriteReport:
        """The snapshot's sets in use and stored. WriteBackFailed where the drive does not hold them afterwards."""
        present = self._check_present(snapshot, expected, None)
        self._check_stopped()
        try:
            is_stored = self._bring_back(snapshot)
            return self._report(snapshot.in_use, present, is_stored=is_stored)
        except DriveError as error:
            raise WriteBackFailed(
                f"the snapshot could not be restored: {error.what}", step="restore", value=error.value,
                limit=error.limit, remedy="run restore again; until then the drive's parameters are not known",
            ) from error

    # --- before -------------------------------------------------------------------------------------------------
    def _complete(self, values: Values, snapshot: ParameterSnapshot) -> dict[str, float]:
        order = self._group().order
        for name in values:
            if name not in order:
                raise UsageError(
                    f"{name} is not one of the drive's motor parameters", step="write parameters", value=name,
                    limit=", ".join(order), remedy=self._profile.unknown.get(name, "leave it out"),
                )
        for name, value in values.items():
            encode_item(self._profile.item(self._prefix("staged_") + name), value)
        return dict(snapshot.in_use) | dict(values)

    def _check_present(
        self, snapshot: ParameterSnapshot, in_use: Values | None, stored: Values | None
    ) -> ParameterSnapshot:
        present = self.snapshot()
        theirs, ours = _key(present.identity), _key(snapshot.identity)
        if theirs != ours:
            raise _changed("the drive is not the one of the snapshot", theirs, ours)
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
                "the drive's output is not blocked", step="write parameters", value=status.state,
                limit="a stopped drive", remedy="stop the motor first",
            )

    def _check_endurance(self, count: int, writes: int) -> None:
        store = self._profile.store
        if store and store.endurance_writes and count + writes > store.endurance_writes:
            raise CheckFailed(
                "the drive's parameter memory is worn out", step="store", value=count,
                limit=f"{store.endurance_writes} writes", remedy="write without storing, or replace the drive's memory",
            )

    # --- act ----------------------------------------------------------------------------------------------------
    def _bring(self, target: Values, *, store: bool) -> None:
        """`target` in use and, if asked, stored; verified; only what differs."""
        has_changed = bool(self._differing(target, self._read_in_use()))
        if has_changed:
            self._put_in_use(target, store=store)
        is_unstored = bool(self._differing(target, self._read_stored())) if self._group().is_staged else has_changed
        if store and is_unstored:
            self._put_in_memory(target)

    def _bring_back(self, snapshot: ParameterSnapshot) -> bool:
        """Both sets of the snapshot; the stored one first where they differ, for a store takes what is in use. True
        where what is in use will outlast a power-off, as far as the drive file can tell."""
        has_to_store = bool(snapshot.stored) and bool(self._differing(snapshot.stored, self._read_stored()))
        if has_to_store:
            self._check_endurance(self._store_count(), writes=1)
            self._bring(snapshot.stored, store=True)
        stores_while_writing = not self._group().is_staged and self._can_store()
        self._bring(snapshot.in_use, store=stores_while_writing)
        return self._group().is_staged or stores_while_writing

    def _put_in_use(self, target: Values, *, store: bool) -> None:
        if self._group().is_staged:
            self._stage(target)
            self._commit()
        else:
            self._write_directly(target, store=store)
        self._sleep(self._group().settle_s)
        self._verify(target, self._read_in_use(), "read back the values in use")

    def _stage(self, target: Values) -> None:
        """Staged registers that differ, then the check sum over all of them; read back together."""
        staged: dict[str, Value] = {f"staged_{name}": target[name] for name in self._group().order}
        crc_name = self._group().staged_crc
        assert crc_name is not None
        held = self._items.read(staged)
        differing = {name: v for name, v in staged.items() if not self._items.same_words(name, held[name], v)}
        words = [word for name, v in staged.items() for word in encode_item(self._profile.item(name), v)]
        crc: dict[str, Value] = {crc_name: crc16_modbus(words)}
        self._journal(Intent(Action.STAGE, differing | crc))
        self._items.write(differing)
        self._items.write(crc)
        seen = self._items.read([*staged, crc_name])
        self._verify(staged | crc, seen, "read back the staged values")

    def _commit(self) -> None:
        values: dict[str, Value] = {"commit": self._profile.commands["commit"]}
        self._journal(Intent(Action.COMMIT, values))
        self._has_asked_to_commit = True
        self._items.write(values)
        self._await_result("commit_result", COMMIT_RESULTS, "commit")

    def _put_in_memory(self, target: Values) -> None:
        if not self._group().is_staged:
            self._store_directly()
            return
        values: dict[str, Value] = {"store": self._profile.commands["store"]}
        self._journal(Intent(Action.STORE, values))
        self._items.write(values)
        self._await_result("store_result", STORE_RESULTS, "store")
        self._verify(target, self._read_stored(), "read back the stored values")

    def _write_directly(self, target: Values, *, store: bool) -> None:
        differing: dict[str, Value] = dict(self._differing(target, self._read_in_use()))
        self._journal(Intent(Action.COMMIT, differing))
        if self._store_settings().coil is not None:
            self._items.port.write_coil(self._store_settings().coil or 0, store)
        for name in self._group().order:
            if name in differing:
                self._items.write({name: differing[name]})

    def _store_directly(self) -> None:
        writes = self._store_settings().writes
        if not writes:
            return
        self._journal(Intent(Action.STORE, {f"register {address}": value for address, value in writes}))
        for address, value in writes:
            self._items.port.write(address, [value])

    def _let_jobs_end(self) -> None:
        """A commit or store whose answer was lost may still be at work: what is read before it ends is not the end."""
        end = self._clock() + RESULT_DEADLINE_S
        jobs = ("commit_result", "store_result")
        while BUSY in self._items.read(jobs).values() and self._clock() < end:
            self._sleep(POLL_S)

    def _await_result(self, item: str, meanings: Mapping[int, str], step: str) -> None:
        end = self._clock() + RESULT_DEADLINE_S
        result = int(self._items.read_number(item))
        while result == BUSY and self._clock() < end:
            self._sleep(POLL_S)
            result = int(self._items.read_number(item))
        if result != DONE:
            raise DriveFault(
                f"the drive did not {step}: {meanings.get(result, 'unknown result')}", step=step, value=result,
                limit=DONE, remedy="check the values against the drive's ranges and that it is stopped",
            )

    def _verify(self, wanted: Mapping[str, Value], seen: Mapping[str, Value], step: str) -> None:
        for name, value in wanted.items():
            if not self._items.same_words(name, seen[name], value):
                raise DriveFault(
                    f"the drive holds {name} = {seen[name]} instead of {value}", step=step, value=seen[name],
                    limit=value, remedy="the drive limits, rounds or recomputes the value; see its manual",
                )

    # --- after --------------------------------------------------------------------------------------------------
    def _after_failure(self, error: DriveError, snapshot: ParameterSnapshot) -> WriteBackFailed:
        try:
            if self._has_asked_to_commit:
                self._stage(snapshot.in_use)  # a commit that is still under way can now only bring these into use
            self._let_jobs_end()
            self._bring_back(snapshot)
            outcome, was_restored = "the values found before are in the drive again, verified", True
        except CommissionerError as second:
            outcome, was_restored = f"the values found before could not be verified: {second.what}", False
        failed = WriteBackFailed(
            f"writing back failed: {error.what}; {outcome}", step=error.step, value=error.value, limit=error.limit,
            remedy=error.remedy if was_restored else "run restore before the drive is used",
        )
        failed.was_restored = was_restored
        return failed

    def _report(self, target: Values, before: ParameterSnapshot, *, is_stored: bool) -> WriteReport:
        after = self._read_in_use()
        rows = tuple(
            WrittenParameter(name, self._profile.item(name).address, before.in_use[name], target[name], after[name])
            for name in self._differing(target, before.in_use)
        )
        store = self._profile.store
        return WriteReport(
            written=rows,
            is_stored=is_stored,
            store_count_before=before.store_count,
            store_count_after=self._store_count(),
            endurance_writes=store.endurance_writes if store else None,
        )

    # --- look ---------------------------------------------------------------------------------------------------
    def _read_in_use(self) -> dict[str, float]:
        return self._read_set("")

    def _read_stored(self) -> dict[str, float]:
        """Empty where the drive cannot show its non-volatile set; its items are then not in the drive file."""
        return self._read_set("stored_")

    def _read_set(self, prefix: str) -> dict[str, float]:
        order = self._profile.parameters.order if self._profile.parameters else ()
        names = [prefix + name for name in order]
        return {name.removeprefix(prefix): number(value) for name, value in self._items.read(names).items()}

    def _store_count(self) -> int:
        return int(number(self._items.read(["store_count"]).get("store_count", 0)))

    def _can_store(self) -> bool:
        store = self._profile.store
        return self._group().is_staged or (store is not None and bool(store.writes or store.coil is not None))

    def _differing(self, wanted: Values, held: Values) -> dict[str, float]:
        return {n: v for n, v in wanted.items() if not self._items.same_words(n, held[n], v)}

    def _prefix(self, prefix: str) -> str:
        return prefix if self._group().is_staged else ""

    def _group(self) -> ParameterGroup:
        if self._profile.parameters is None:
            raise UsageError(
                f"{self._profile.name} has no motor parameters that are known", step="read parameters", value=None,
                limit="a table [parameters] in the drive file",
                remedy=self._profile.unknown.get("parameters", "complete the drive file from the vendor's manual"),
            )
        return self._profile.parameters

    def _store_settings(self) -> Store:
        return self._profile.store or Store(None)


def _key(identity: DriveIdentity) -> DriveIdentity:
    """What must not change between snapshot and write: type, serial number, firmware, map."""
    return replace(identity, rated_drive_current_a=0.0, control_period_s=0.0, switching_frequency_hz=0.0)


def _changed(what: str, seen: object, wanted: object) -> IdentityMismatch:
    return IdentityMismatch(
        what, step="compare with the snapshot", value=seen, limit=wanted,
        remedy="someone or something changed the drive meanwhile; take a new snapshot by running again",
    )
