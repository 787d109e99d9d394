"""A drive in memory behind the `Port` seam: the commissioning map as `config/drives/simulated.toml` tells it, no wire.

It knows the map from the file alone (parsed here, not by the product). What it does wrong is chosen by the test:

    drive = ScriptedDrive()
    drive.deaf_to.add("amplitude_scale")        # acknowledges the write, does not do it
    drive.failures.append(ReplyTimeout(...))    # the next request fails with this, before the drive sees it,
    drive.fails_after_acting = True             # or after the drive did what a write asked for
    drive.on_write = lambda name, words: ...    # anything else
"""

from __future__ import annotations

import struct
import tomllib
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path

from commissioner.errors import CommissionerError, RequestRefused
from commissioner.link.wire.port import LinkStats

MAP = Path(__file__).resolve().parents[2] / "config" / "drives" / "simulated.toml"
WORDS = {"u16": 1, "i16": 1, "u32": 2, "i32": 2, "f32": 2, "ascii": 1}
FORMS = {"u16": ">H", "i16": ">h", "u32": ">I", "i32": ">i", "f32": ">f"}
PARAMETERS = ("stator_resistance", "rotor_resistance", "leakage_inductance", "magnetizing_inductance")
PRESENT = (3.0, 2.0, 20.0, 300.0)
"""Parameters the drive holds at first: ohm, ohm, mH, mH as on the wire."""

UNCOUNTED = ("heartbeat", "window_index", "echo", "commit", "store", "owner_token", "owner_timeout_s", "owner_name")

STATUS = {"disabled": 0x40, "ready": 0x21, "switched on": 0x23, "enabled": 0x27, "fault": 0x08}


def crc16(data: bytes) -> int:
    """CRC-16/MODBUS, bit by bit as the specification draws it."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ 0xA001 if crc & 1 else crc >> 1
    return crc


class ScriptedDrive:
    """Registers, a CiA 402 state machine without time, a window over `samples` (rows of raw channel counts)."""

    def __init__(self) -> None:
        self.document = tomllib.loads(MAP.read_text("utf-8"))
        self.items = self.document["items"]
        self.words = [0] * 0x10000
        self.stats = LinkStats()
        self.read_retries = 0
        self.reply_timeout_s = 0.1
        self.state = "disabled"
        self.samples: list[tuple[int, ...]] = []
        self.first_kept = 0
        self.has_ended = False
        self.deaf_to: set[str] = set()
        self.refuses: dict[str, int] = {}
        self.failures: deque[CommissionerError | None] = deque()
        self.fails_after_acting = False
        self.on_write: Callable[[str, tuple[int, ...]], None] = lambda name, words: None
        self.log: list[tuple[str, str]] = []
        self.is_closed = False
        self.doubts = 0
        self.commit_result = self.store_result = 2
        self._power_up()

    # --- the port ----------------------------------------------------------------------------------------------
    def read(self, address: int, count: int) -> tuple[int, ...]:
        self._fail()
        self._refresh()
        return tuple(self.words[address : address + count])

    def write(self, address: int, values: Sequence[int]) -> None:
        failure = self.failures.popleft() if self.failures else None
        if failure is not None and not self.fails_after_acting:
            raise failure
        before = self._settings()
        for name, item in self.items.items():
            length = item.get("length", 1) * WORDS[item["type"]]
            if address <= item["address"] < address + len(values):
                start = item["address"] - address
                self._take(name, tuple(values[start : start + length]))
        self.put("settings_count", (int(self.get("settings_count")) + (self._settings() != before)) & 0xFFFF)
        if failure is not None:
            raise failure

    def exchange(
        self, write_address: int, values: Sequence[int], read_address: int, count: int, *, proves_itself: bool = False
    ) -> tuple[int, ...]:
        self.write(write_address, values)
        self._refresh()
        return tuple(self.words[read_address : read_address + count])

    def write_coil(self, address: int, value: bool) -> None:
        self._fail()
        self.log.append((f"coil {address}", str(value)))

    def read_coil(self, address: int) -> bool:
        self._fail()
        return False

    def doubt(self) -> None:
        self.doubts += 1

    def close(self) -> None:
        self.is_closed = True

    # --- for tests -----------------------------------------------------------------------------------------------
    def get(self, name: str) -> float:
        item = self.items[name]
        start = item["address"]
        raw = struct.pack(f">{WORDS[item['type']]}H", *self.words[start : start + WORDS[item["type"]]])
        return struct.unpack(FORMS[item["type"]], raw)[0]

    def put(self, name: str, value: float | str) -> None:
        """Set an item's raw value, past every lock."""
        item = self.items[name]
        if item["type"] == "ascii":
            data = str(value).encode().ljust(2 * item["length"], b"\0")
        else:
            data = struct.pack(FORMS[item["type"]], value)
        self.words[item["address"] : item["address"] + len(data) // 2] = struct.unpack(f">{len(data) // 2}H", data)

    def written(self, name: str) -> list[str]:
        """What was written to the item, in order."""
        return [words for item, words in self.log if item == name]

    # --- firmware ------------------------------------------------------------------------------------------------
    def _power_up(self) -> None:
        identity = self.document["identity"]
        for name, value in {
            "magic": identity["magic"],
            "map_version": 1,
            "firmware_version": 0x00010203,
            "serial_number": 4711,
            "drive_type": identity["drive_type"],
            "rated_drive_current_a": 7.0,
            "control_period_s": 200_000,
            "switching_frequency_hz": 5000.0,
            "interlocks": 0b11111,
            "dc_link_v": 560.0,
            "heatsink_degc": 30.0,
            "winding_degc": float("nan"),
            "current_scale_a": 0.001,
            "voltage_scale_v": 0.02,
            "dc_link_scale_v": 0.05,
            "rated_power_w": 2200.0,
            "rated_voltage_v": 400.0,
            "rated_frequency_hz": 50.0,
            "rated_current_a": 5.0,
            "rated_speed_rpm": 1436.0,
            "power_factor": 0.8,
            "pole_pairs": 2,
            "session_id": 100,
            "store_count": 17,
        }.items():
            self.put(name, value)
        for name, value in zip(PARAMETERS, PRESENT, strict=True):
            for prefix in ("", "staged_", "stored_"):
                self.put(prefix + name, value)

    def _settings(self) -> list[tuple[int, ...]]:
        """The words of every setting whose change is counted."""
        counted = [item for name, item in self.items.items() if "w" in item["access"] and name not in UNCOUNTED]
        spans = [(i["address"], i.get("length", 1) * WORDS[i["type"]]) for i in counted]
        return [tuple(self.words[start : start + count]) for start, count in spans]

    def _fail(self) -> None:
        failure = self.failures.popleft() if self.failures else None
        if failure is not None:
            raise failure

    def _take(self, name: str, words: tuple[int, ...]) -> None:
        self.log.append((name, " ".join(f"{word:04x}" for word in words)))
        self.on_write(name, words)
        if name in self.refuses:
            code = self.refuses[name]
            raise RequestRefused(f"exception {code}", step="write", value=code, limit="", remedy="")
        if name in self.deaf_to:
            return
        start = self.items[name]["address"]
        self.words[start : start + len(words)] = words
        effect = {"control_word": self._command, "commit": self._commit, "store": self._store}.get(name)
        if effect is not None:
            effect(words[0])

    def _command(self, word: int) -> None:
        if self.state == "fault":
            self.state = "disabled" if word & 0x80 else "fault"
            return
        follow = {
            0x06: "ready",
            0x07: "switched on" if self.state in ("ready", "enabled") else self.state,
            0x0F: "enabled" if self.state == "switched on" else self.state,
            0x02: "disabled",
            0x00: "disabled",
        }
        before, self.state = self.state, follow.get(word, self.state)
        if self.state == "enabled" and before != "enabled":
            self.put("session_id", (int(self.get("session_id")) + 1) & 0xFFFF)

    def _commit(self, word: int) -> None:
        start = self.items["staged_stator_resistance"]["address"]
        data = struct.pack(">8H", *self.words[start : start + 8])
        good = crc16(data) == self.get("staged_crc")
        result = self.commit_result if word == self.document["commands"]["commit"] else 0
        self.put("commit_result", result if good else 3)
        if good and result == 2:
            for name in PARAMETERS:
                self.put(name, self.get("staged_" + name))

    def _store(self, word: int) -> None:
        result = self.store_result if word == self.document["commands"]["store"] else 0
        self.put("store_result", result)
        if result == 2:
            self.put("store_count", self.get("store_count") + 1)
            for name in PARAMETERS:
                self.put("stored_" + name, self.get(name))

    def _refresh(self) -> None:
        self.put("status_word", STATUS[self.state])
        self.put("heartbeat_echo", self.get("heartbeat"))
        self.put("present_scale", self.get("amplitude_scale"))
        self.put("samples_produced", len(self.samples))
        window = self.window(int(self.get("window_index")))
        start = self.document["window"]["address"]
        self.words[start : start + len(window)] = window

    def window(self, index: int) -> list[int]:
        """The window's words for a start index."""
        layout = self.document["window"]
        mask = int(self.get("channel_mask")) or 7
        channels = mask.bit_count()
        first = max(index, self.first_kept)
        rows = self.samples[first : first + layout["data_registers"] // channels]
        flags = (layout["flag_running"] if self.state == "enabled" else 0) | (
            layout["flag_overrun"] if first > index else 0
        )
        if self.has_ended and first + len(rows) >= len(self.samples):
            flags |= layout["flag_ended"]
        header = struct.pack(">HIHHHh", int(self.get("session_id")), first, len(rows), mask, flags, 11200)
        data = b"".join(struct.pack(f">{channels}h", *row) for row in rows)
        checked = header + data
        whole = header + struct.pack(">H", crc16(checked)) + data.ljust(2 * layout["data_registers"], b"\0")
        return list(struct.unpack(f">{len(whole) // 2}H", whole))
