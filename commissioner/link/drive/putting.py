"""The two ways in which drives take motor parameters: staged and committed at once, or register by register."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress

from commissioner.errors import DriveFault, ReplyMismatch, ReplyTimeout, RequestRefused
from commissioner.link.drive.facts import Action, Intent, Journal
from commissioner.link.drive.ordinary.insisting import insist
from commissioner.link.drive.ordinary.unlocking import unlocked
from commissioner.link.drive.parameter_sets import ParameterSets, Values
from commissioner.registers.codec import Value
from commissioner.registers.convention import staged_words_crc

BUSY, DONE = 1, 2
RESULT_DEADLINE_S = 5.0
POLL_S = 0.01
STORE_POLL_S = 0.1
COMMIT_RESULTS = {
    0: "nothing happened",
    1: "still busy",
    3: "check sum wrong",
    4: "value out of the drive's range",
    5: "not stopped",
}
STORE_RESULTS = {0: "nothing happened", 1: "still busy", 3: "the memory failed", 5: "not stopped"}


class Staged:
    """Values are staged, looked at, and taken into use by one commit with a check sum; stored by another command."""

    def __init__(
        self, sets: ParameterSets, journal: Journal, sleep: Callable[[float], None], clock: Callable[[], float]
    ) -> None:
        self._sets, self._items, self._commands = sets, sets.items, sets.profile.commands
        self._journal, self._sleep, self._clock = journal, sleep, clock
        self._has_asked_to_commit = self._has_asked_to_store = False

    @property
    def can_be_called_off(self) -> bool:
        """Whether what was asked for, and may still be under way, can be made harmless: a commit by other staged values, a store by nothing."""
        return not self._has_asked_to_store

    def put_in_use(self, target: Values, *, store: bool) -> None:
        self._stage(target)
        values: dict[str, Value] = {"commit": self._commands["commit"]}
        self._journal(Intent(Action.COMMIT, values))
        self._has_asked_to_commit = True
        self._items.write(values)
        self._await_result("commit_result", COMMIT_RESULTS, "commit")

    def put_in_memory(self, target: Values) -> None:
        values: dict[str, Value] = {"store": self._commands["store"]}
        self._journal(Intent(Action.STORE, values))
        self._has_asked_to_store = True
        self._items.write(values)
        self._await_result("store_result", STORE_RESULTS, "store")
        self._sets.verify(target, self._sets.stored(), "read back the stored values")

    def keep(self, target: Values) -> None:
        """What is in use becomes lasting."""
        self.put_in_memory(target)

    def take_back(self, values: Values) -> None:
        """A commit that is still under way can after this only bring `values` into use."""
        if self._has_asked_to_commit:
            self._stage(values)

    def put_again(self, values: Values, *, store: bool) -> None:
        """Its one commit and its result leave nothing in doubt."""

    def let_jobs_end(self) -> None:
        """A commit or store whose answer was lost may still be at work: what is read before it ends is not the end."""
        end = self._clock() + RESULT_DEADLINE_S
        jobs = ("commit_result", "store_result")
        while BUSY in self._items.read(jobs).values() and self._clock() < end:
            self._sleep(POLL_S)

    def _stage(self, target: Values) -> None:
        """Staged registers that differ, then the check sum over all of them; read back together."""
        staged: dict[str, Value] = {f"staged_{name}": target[name] for name in self._sets.group.order}
        crc_name = self._sets.group.staged_crc
        assert crc_name is not None
        held = self._items.read(staged)
        differing = {name: v for name, v in staged.items() if not self._items.same_words(name, held[name], v)}
        crc: dict[str, Value] = {crc_name: staged_words_crc(target, self._sets.profile)}
        self._journal(Intent(Action.STAGE, differing | crc))
        self._items.write(differing)
        self._items.write(crc)
        seen = self._items.read([*staged, crc_name])
        self._sets.verify(staged | crc, seen, "read back the staged values")

    def _await_result(self, item: str, meanings: Mapping[int, str], step: str) -> None:
        end = self._clock() + RESULT_DEADLINE_S
        result = int(self._items.read_number(item))
        while result == BUSY and self._clock() < end:
            self._sleep(POLL_S)
            result = int(self._items.read_number(item))
        if result != DONE:
            meaning = meanings.get(result, "unknown result")
            raise DriveFault(
                f"the drive did not {step}: {meaning}", step=step, value=f"{meaning} ({result})", limit=f"done ({DONE})",
                remedy="check the values against the drive's ranges and that it is stopped",
            )  # fmt: skip


class Direct:
    """Each value takes effect as it is written; what stores it stands in the drive file."""

    def __init__(
        self, sets: ParameterSets, journal: Journal, sleep: Callable[[float], None], clock: Callable[[], float]
    ) -> None:
        self._sets, self._items, self._journal = sets, sets.items, journal
        self._sleep, self._clock = sleep, clock
        self._sent: set[str] = set()
        self._was_stored = False

    @property
    def can_be_called_off(self) -> bool:
        """Nothing was sent yet, as where the drive's lock did not open: what was, a drive may show late."""
        return not self._sent

    def put_in_use(self, target: Values, *, store: bool) -> None:
        differing = self._sets.differing(target, self._sets.in_use())
        self._was_stored |= store
        self._put(differing, self._write, store=store)

    def _put(self, values: Values, write: Callable[[str, Value], None], *, store: bool) -> None:
        self._journal(Intent(Action.COMMIT, dict(values)))
        with self._unlocked():
            with self._store_mode(store):
                for name in self._sets.group.order:
                    if name in values:
                        write(name, values[name])
            for address, value in self._sets.group.enter:
                self._items.port.write(address, [value])

    def put_in_memory(self, target: Values) -> None:
        store = self._sets.store
        if not store.writes:
            return
        self._journal(Intent(Action.STORE, {f"register {address}": value for address, value in store.writes}))
        with self._unlocked():
            for address, value in store.writes:
                self._items.port.write(address, [value])
        if store.done is not None:
            self._await_stored(*store.done, store.within_s)

    def _write(self, name: str, value: Value) -> None:
        """Where the answer is lost the drive is looked at, not written again: the value may have arrived."""
        self._sent.add(name)
        try:
            self._items.give_back(name, value)
        except (ReplyTimeout, ReplyMismatch):
            if self._sets.group.enter or not self._items.same_words(name, self._items.read([name])[name], value):
                raise

    def _unlocked(self) -> AbstractContextManager[None]:
        return unlocked(self._items.port, self._sets.profile)

    @contextmanager
    def _store_mode(self, store: bool) -> Iterator[None]:
        """The coil that says whether writes are lasting, put back to what it was; off where it cannot be read."""
        coil, port = self._sets.store.coil, self._items.port
        if coil is None:
            yield
            return
        try:
            before = port.read_coil(coil)
        except RequestRefused:
            before = False
        port.write_coil(coil, store)
        try:
            yield
        finally:
            insist(lambda: port.write_coil(coil, before))

    def _await_stored(self, address: int, value: int, within_s: float) -> None:
        end = self._clock() + within_s
        while (seen := self._items.port.read(address, 1)[0]) != value:
            if self._clock() > end:
                raise DriveFault(
                    f"the drive did not say that its memory is written: register {address} holds {seen}", step="store",
                    value=seen, limit=f"{value} within {within_s:g} s", remedy="store at the drive's keypad and look again",
                )  # fmt: skip
            self._sleep(STORE_POLL_S)

    def keep(self, target: Values) -> None:
        """What is in use becomes lasting, whoever wrote it: by the coil it is written once more, as it stands."""
        if self._sets.store.coil is not None:
            self._journal(Intent(Action.STORE, dict(target)))
            with self._unlocked(), self._store_mode(True):
                for name in self._sets.group.order:
                    self._write(name, target[name])
        self.put_in_memory(target)

    def take_back(self, values: Values) -> None:
        """Whatever was sent is sent once more, as it was before: a drive that shows a value late still shows the old one, and has the new."""
        if self._sent:
            self.put_again({name: values[name] for name in values if name in self._sent}, store=self._was_stored)

    def put_again(self, values: Values, *, store: bool) -> None:
        """Written whether the drive shows them already or not; what it refuses it has not taken before either."""
        self._put(values, self._write_unless_refused, store=store)

    def _write_unless_refused(self, name: str, value: Value) -> None:
        with suppress(RequestRefused):
            self._write(name, value)

    def let_jobs_end(self) -> None:
        """There are none."""
