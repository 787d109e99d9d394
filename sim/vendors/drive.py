"""An ordinary drive behind its face: it answers requests, keeps what it was told to keep, and tunes itself for better or worse."""

from __future__ import annotations

import random
import struct
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from sim.vendors.face import Cell, Face
from sim.vendors.mailbox import Mailbox
from sim.vendors.motor import HEATING_K, Motor

BAD_FUNCTION, BAD_ADDRESS, BAD_VALUE, FAILURE, BUSY = 1, 2, 3, 4, 6
TUNINGS = ("good", "fails", "hangs", "keypad", "turns", "wrong")
"""How a tuning goes: as it should; reports a failure; never ends; is ended at the keypad; turns the shaft; finds nonsense."""
REST, READY, ON, ENABLED, TRIP = 0x40, 0x21, 0x23, 0x27, 0x08
STORE_S, RECOMPUTE_S = 0.4, 0.3
"""From a store or a plate written over the bus until the memory is written, until the circuit is computed anew."""


@dataclass(frozen=True)
class Habits:
    """How this one behaves. `tunings`: one word of TUNINGS for each tuning in turn, the last one for all that follow."""

    tunings: tuple[str, ...] = ("good",)
    tuning_s: float = 4.0
    needs_enter: bool = False
    is_local: bool = False
    watchdog_s: float = 0.0
    loses_start_answer: bool = False
    stores: bool = True
    ignores_when_locked: bool = False
    """Takes a write without its unlock in silence, instead of refusing it."""
    busy_s: float = 0.0
    """So long after each write it refuses the next as busy."""
    late_s: float = 0.0
    """So long after a parameter is written it still shows the value before."""
    refuses_from: int | None = None
    """From this parameter on, counted from 1, it takes none that is written."""


@dataclass
class Tuning:
    """One that runs or has ended; `found`: what it left in the registers."""

    how: str
    began_s: float
    found: dict[str, float] = field(default_factory=dict)
    end: str = "running"


class VendorDrive:
    """`answer` takes a request without framing and gives the reply's; None: silence. `clock` in seconds."""

    def __init__(
        self,
        face: Face,
        clock: Callable[[], float],
        *,
        motor: Motor | None = None,
        habits: Habits | None = None,
        seed: int = 0,
    ) -> None:
        self.face, self.motor, self.habits = face, motor or Motor(), habits or Habits()
        self._clock, self._rng = clock, random.Random(seed)
        self.words: dict[int, int] = {}
        self.stored: dict[int, int] = {}
        self.coils = {face.store_coil: False} if face.store_coil is not None else {}
        self.entered: dict[int, int] = {}
        self.shown: dict[int, tuple[float, int]] = {}
        self.written = 0
        self.tunings: list[Tuning] = []
        self.state, self.speed, self.is_on = REST, 0, True
        self.turned = self.was_energised_s = 0.0
        self.is_local = self.habits.is_local
        self._heard_s = self._seen_s = clock()
        self._store_until = self._busy_until = self._compute_at = 0.0
        self.is_locked = bool(face.unlocks)
        self.mailbox: Mailbox | None = None
        if face.mailbox is not None:
            behind = {name: cell for name, cell in face.cells.items() if cell.parameter is not None}
            self.mailbox = Mailbox(face.mailbox, behind, clock, self._words_of, self._put_from_outside)
        self._factory()

    # --- memory -------------------------------------------------------------------------------------------------------
    def _factory(self) -> None:
        """Set up for its motor, with values of its own size of motor: near, not right."""
        for cell in self.face.cells.values():
            value = self.motor.plate.get(cell.name, 0.0)
            if cell.name in self.face.parameters or cell.name in self._results():
                value = self.motor.true(cell) * 1.15 if hasattr(self.motor, cell.name) else 0.0
            if cell.name == "dc_link_v":
                value = 565.0
            self._put(cell, value)
        for address, _ in (*self.face.stores, *self.face.enters, *self.face.unlocks, *self.face.locks):
            self.words.setdefault(address, 0)
        if self.face.store_done is not None:
            self.words[self.face.store_done[0]] = self.face.store_done[1]
        self.stored = dict(self.words)

    def _results(self) -> list[str]:
        return list((self.face.tune or {}).get("results", []))

    def _put(self, cell: Cell, value: float) -> None:
        for k, word in enumerate(cell.to_words(value)):
            self.words[cell.address + k] = word

    def value(self, name: str) -> float:
        """What the drive really holds."""
        cell = self.face.cells[name]
        return cell.to_value([self.words[cell.address + k] for k in range(cell.width)])

    # --- at the drive -------------------------------------------------------------------------------------------------
    def press_tune(self) -> None:
        """The person starts the drive's own tuning at standstill at the keypad."""
        self._begin()

    def press_stop(self) -> None:
        self._stop()

    def press_save(self) -> None:
        """Everything in use becomes lasting."""
        self._keep()

    def press_remote(self) -> None:
        self.is_local = False

    def set_plate(self, **plate: float) -> None:
        """Typed at the keypad: the drive computes its circuit anew from its own table."""
        self.motor.plate |= plate
        for name, value in plate.items():
            self._put(self.face.cells[name], value)
        self._compute_circuit()

    def _compute_circuit(self) -> None:
        for cell in self.face.cells.values():
            if cell.name in self._results():
                self._put(cell, 1.3 * self.motor.true(cell))

    def power_cycle(self) -> None:
        """Off and on: what was not stored is gone."""
        self.words = dict(self.stored)
        self.entered.clear()
        self.shown.clear()
        self.coils = dict.fromkeys(self.coils, False)
        self.state, self.speed = REST, 0
        self.is_locked = bool(self.face.unlocks)
        self._heard_s = self._clock()

    # --- the wire -----------------------------------------------------------------------------------------------------
    def answer(self, pdu: bytes) -> bytes | None:
        """The reply to one request."""
        self._pass_time()
        self._heard_s = self._clock()
        function = pdu[0]
        if function not in self.face.functions:
            return bytes((function | 0x80, BAD_FUNCTION))
        address, number = struct.unpack(">HH", pdu[1:5])
        if function in (1, 5):
            return self._coil(function, address, number, pdu)
        if function == 3:
            return self._read(address, number)
        words = [number] if function == 6 else list(struct.unpack(f">{number}H", pdu[6:]))
        code = self._write(address, words, longest=1 if function == 6 else self.face.longest_write)
        if code < 0:
            return None
        return bytes((function | 0x80, code)) if code else pdu[:5]

    def _coil(self, function: int, address: int, number: int, pdu: bytes) -> bytes:
        if address not in self.coils:
            return bytes((function | 0x80, BAD_ADDRESS))
        if function == 5:
            self.coils[address] = number == 0xFF00
            return pdu
        return bytes((1, 1, self.coils[address]))

    def _read(self, address: int, count: int) -> bytes:
        if self.mailbox is not None and self.mailbox.covers(address, count):
            return struct.pack(f">BB{count}H", 3, 2 * count, *self.mailbox.read(address, count))
        if not 1 <= count <= self.face.longest_read:
            return bytes((0x83, BAD_VALUE))
        if any(address + k not in self.words for k in range(count)):
            return bytes((0x83, BAD_ADDRESS))
        self._refresh()
        return struct.pack(f">BB{count}H", 3, 2 * count, *(self._shown(address + k) for k in range(count)))

    def _shown(self, address: int) -> int:
        until_s, word = self.shown.get(address, (0.0, 0))
        return word if self._clock() < until_s else self.words[address]

    def _write(self, address: int, words: list[int], longest: int) -> int:
        """0 taken; an exception's number; -1 taken in silence."""
        if self._clock() < self._busy_until:
            return self.face.busy_code or BUSY
        if self.mailbox is not None and self.mailbox.covers(address, len(words)):
            self.mailbox.write(address, words)
            return 0
        cells = [c for c in self.face.cells.values() if c.address <= address < c.address + c.width]
        if len(words) > longest:
            return BAD_VALUE
        if (address, words[0]) in self.face.unlocks or (address, words[0]) in self.face.locks:
            self.is_locked = (address, words[0]) in self.face.locks
            return 0
        if (address, words[0]) in self.face.stores or (address, words[0]) in self.face.enters:
            return self._action(address, words[0])
        if not cells or not cells[0].is_writable:
            return BAD_ADDRESS
        if len(words) != cells[0].width:
            return BAD_VALUE
        return self._put_from_outside(cells[0], words)

    def _words_of(self, cell: Cell) -> list[int]:
        self._refresh()
        return [self._shown(cell.address + k) for k in range(cell.width)]

    def _put_from_outside(self, cell: Cell, words: Sequence[int]) -> int:
        """As `_write`: what the drive's state has to say to it, and whether it is locked."""
        if (cell.needs_stop and self.is_energised) or self.is_local:
            return FAILURE
        if self.is_locked and not self._is_command(cell):
            return 0 if self.habits.ignores_when_locked else FAILURE
        code = self._take(cell, words)
        if not code and not self._is_command(cell):
            self._busy_until = self._clock() + self.habits.busy_s
        return code

    def _is_command(self, cell: Cell) -> bool:
        """Control words are taken whether locked or not."""
        return cell.name == (self.face.tune or {}).get("facts", {}).get("stop", {}).get("item")

    def _action(self, address: int, value: int) -> int:
        """A word that stores or enters: what was entered is in use from now on."""
        self.words |= self.entered
        self.entered.clear()
        if (address, value) in self.face.stores and not self.is_locked:
            if self.habits.stores:
                self._keep()
            if self.face.store_done is not None:
                self.words[address] = value
                self._store_until = self._clock() + STORE_S
        return 0

    def _keep(self) -> None:
        self.stored = dict(self.words)

    def _take(self, cell: Cell, words: Sequence[int]) -> int:
        facts = (self.face.tune or {}).get("facts", {})
        new = {cell.address + k: word for k, word in enumerate(words)}
        if cell.name in self.face.parameters and not self._agrees(new):
            return BAD_VALUE
        if cell.name == facts.get("stop", {}).get("item"):
            self.words |= new
            return self._command(words[0])
        if cell.name == facts.get("start", {}).get("item") and words[0] == facts["start"]["value"]:
            return self._start()
        if self.habits.needs_enter and self.face.enters:
            self.entered |= new
        else:
            self.words |= new
        if self.face.store_coil is not None and self.coils[self.face.store_coil]:
            self.stored |= new
        if cell.name in self.motor.plate:
            self.motor.plate[cell.name] = cell.to_value(words)
            self._compute_at = self._clock() + RECOMPUTE_S
        return 0

    def _agrees(self, new: Iterable[int]) -> bool:
        """To a parameter that is written at these addresses; whether it shows it at once is another question."""
        self.written += 1
        until_s = self._clock() + self.habits.late_s
        self.shown |= {address: (until_s, self._shown(address)) for address in new}
        return self.habits.refuses_from is None or self.written < self.habits.refuses_from

    # --- states -------------------------------------------------------------------------------------------------------
    @property
    def is_energised(self) -> bool:
        return self.state == ENABLED or any(t.end == "running" for t in self.tunings)

    def _command(self, word: int) -> int:
        """The control word of CiA 402, as far as a drive at rest needs it."""
        low = word & 0x0F
        if self.state == TRIP:
            return 0
        if low == 0x06 and self.state in (REST, ON):
            self.state = READY
        elif low == 0x07 and self.state == READY:
            self.state = ON
        elif low == 0x0F and self.state == ON:
            self.state = ENABLED
            if not word & 0x100:
                self.speed, self.turned = 500, self.turned + 1.0  # without halt it runs
        elif not low & 0x02:
            self._stop()
        return 0

    def _stop(self) -> None:
        self.state, self.speed = REST, 0
        for tuning in self.tunings:
            if tuning.end == "running":
                tuning.end = "stopped"
                self._status(0)

    def _start(self) -> int:
        if self.state != ENABLED:
            return FAILURE
        self._begin()
        return -1 if self.habits.loses_start_answer else 0

    def _begin(self) -> None:
        number = min(len(self.tunings), len(self.habits.tunings) - 1)
        self.tunings.append(Tuning(self.habits.tunings[number], self._clock()))
        self._status(2)

    def _status(self, raw: int) -> None:
        finished = (self.face.tune or {}).get("facts", {}).get("finished")
        if finished:
            self.words[self.face.cells[finished["item"]].address] = raw

    # --- time ---------------------------------------------------------------------------------------------------------
    def _pass_time(self) -> None:
        now = self._clock()
        self.motor.cool(now - self._seen_s)
        self._seen_s = now
        if self.is_energised and self.habits.watchdog_s and now - self._heard_s > self.habits.watchdog_s:
            self._stop()
            self.state = TRIP
        if self.face.store_done is not None and self._store_until and now >= self._store_until:
            self.words[self.face.store_done[0]] = self.face.store_done[1]
        if self._compute_at and now >= self._compute_at:
            self._compute_at = 0.0
            self._compute_circuit()
        running = next((t for t in self.tunings if t.end == "running"), None)
        if running is not None:
            self._go_on(running, now - running.began_s)

    def _go_on(self, tuning: Tuning, for_s: float) -> None:
        if tuning.how == "turns" and for_s > 0.5:
            self.speed, self.turned = 900, self.turned + 1.0
        if tuning.how == "keypad" and for_s > 0.5 * self.habits.tuning_s:
            tuning.end = "ended at the keypad"
            self._status(0)
        elif tuning.how != "hangs" and for_s >= self.habits.tuning_s:
            self._end(tuning)

    def _end(self, tuning: Tuning) -> None:
        if tuning.how == "fails":
            tuning.end = "failed"
            self._status(3)
            return
        error = 0.6 if tuning.how == "wrong" else 0.0
        for name in self._results():
            cell = self.face.cells[name]
            tuning.found[name] = self.motor.tuned(cell, self._rng, error)
            self._put(cell, tuning.found[name])
        self.motor.warm_k += HEATING_K
        tuning.end, self.speed = "done", 0
        self._status(4)

    def _refresh(self) -> None:
        """What the drive says about itself at this moment."""
        word = self.face.cells.get("status_word")
        if word is not None:
            self.words[word.address] = self.state if self.face.decoder == "cia402" else self._bits()
        for name in ("unfiltered_speed", "speed_rpm"):
            if name in self.face.cells:
                self.words[self.face.cells[name].address] = self.speed

    def _bits(self) -> int:
        bits = self.face.bits
        up = {"ready": not self.is_energised, "running": self.is_energised, "fault": self.state == TRIP}
        up["bus_control"] = not self.is_local
        return sum(1 << bits[name] for name, is_set in up.items() if is_set and name in bits)

    # --- the answer key ---------------------------------------------------------------------------------------------
    def truth(self) -> dict[str, Any]:
        """What was true: the motor, every tuning and how it ended, what is held and what is stored."""
        self._pass_time()
        cells = {
            name: self.face.cells[name] for name in {*self._results(), *self.face.parameters} if name in self.face.cells
        }
        return {
            "drive": self.face.title,
            "true": {name: self.motor.true(cell) for name, cell in cells.items() if hasattr(self.motor, name)},
            "held": {name: self.value(name) for name in cells},
            "stored": {
                name: cell.to_value([self.stored[cell.address + k] for k in range(cell.width)])
                for name, cell in cells.items()
            },
            "tunings": [{"how": t.how, "end": t.end, "found": t.found} for t in self.tunings],
            "is_energised": self.is_energised,
            "turned": self.turned > 0,
            "coils": {str(k): v for k, v in self.coils.items()},
        }
