"""The register face of the drive: map checks on the way in, live values on the way out."""

from __future__ import annotations

import math
from typing import Any

from sim.drive.claim import UNCOUNTED
from sim.drive.drive_map import Item
from sim.drive.firmware import Firmware
from sim.drive.parameters import PARAMETERS
from sim.drive.samples import VOLTAGE_STEP_V
from sim.drive.states import Answer
from sim.physics import layout as at

NOT_NEGATIVE = (
    "scale_ramp_per_s",
    "bias_ramp_v_per_s",
    "duration_s",
    "current_limit_a",
    "voltage_limit_v",
    "test_time_limit_s",
)


class Registers:
    """Reads and writes of any run of mapped registers. A refusal is an `Answer`: the Modbus exception code."""

    def __init__(self, drive: Firmware) -> None:
        self.drive = drive
        self.window: list[int] = []

    def read(self, address: int, count: int) -> list[int] | Answer:
        """Words of any run of mapped registers; the window is built when its first register is asked for."""
        first = self.drive.map.window_address
        if first <= address < first + self.drive.map.window_words:
            return self._read_window(address - first, count)
        words: list[int] = []
        self.drive.claim.expire(self.drive.now())
        status = status_values(self.drive)
        while len(words) < count:
            item = self.drive.map.by_address.get(address + len(words))
            if item is None:
                return Answer.NO_SUCH_ADDRESS
            skip = address + len(words) - item.address
            value = self.drive.values[item.name] if item.is_writable else status[item.name]
            words += item.encode(value)[skip : skip + count - len(words)]
        return words

    def write(self, address: int, words: list[int]) -> Answer:
        """All items of the request or none: existence, access, state and range are checked before any is changed."""
        changes: list[tuple[Item, Any]] = []
        at_word = 0
        while at_word < len(words):
            item = self.drive.map.by_address.get(address + at_word)
            if item is None or not item.is_writable:
                return Answer.NO_SUCH_ADDRESS
            value, used = self._value_written(item, address + at_word - item.address, words[at_word:])
            if used == 0:
                return Answer.NO_SUCH_ADDRESS
            if item.needs_stop and self.drive.is_energised:
                self.drive.log.write("write_refused", self.drive.t, item=item.name)
                return Answer.BUSY
            if not self._is_allowed(item, value):
                return Answer.BAD_VALUE
            changes.append((item, value))
            at_word += used
        held = self.drive.values
        self.drive.settings_count += any(held[i.name] != v for i, v in changes if i.name not in UNCOUNTED)
        self.drive.settings_count &= 0xFFFF
        for item, value in sorted(changes, key=lambda change: change[0].name == "control_word"):
            self.drive.take(item.name, value)
        return Answer.DONE

    def _value_written(self, item: Item, skip: int, words: list[int]) -> tuple[Any, int]:
        """(value, words used); arrays may be written in part, value by value; a number never by half."""
        if skip % item.words_each or len(words) < min(item.words_each, item.words - skip):
            return None, 0
        used = min(item.words - skip, len(words) - len(words) % item.words_each)
        if used == item.words:
            return item.decode(words[:used]), used
        present = item.encode(self.drive.values[item.name])
        present[skip : skip + used] = words[:used]
        return item.decode(present), used

    def _is_allowed(self, item: Item, value: Any) -> bool:
        if not item.accepts(value) or item.name in self.drive.setup.refuses:
            return False
        if item.name == "owner_token":
            return self.drive.claim.admits(value, self.drive.now())
        if item.name == "watchdog_ms":
            shortest = self.drive.map.document["watchdog"]["min_ms"]
            return self.drive.setup.takes_watchdog and (value == 0 or value >= shortest)
        if item.name == "amplitude_scale":
            return 0.0 <= value <= 1.0
        if item.name == "channel_mask":
            return 1 <= value <= 0b1111
        return item.name not in NOT_NEGATIVE or value >= 0.0

    def _read_window(self, skip: int, count: int) -> list[int] | Answer:
        """The window is built when its first register is asked for; later registers are of that same window."""
        samples = self.drive.samples
        if skip + count > self.drive.map.window_words:
            return Answer.NO_SUCH_ADDRESS
        if skip == 0 or not self.window:
            fitting = samples.fitting(count) if skip == 0 else 0
            self.window = samples.window(
                int(self.drive.values["window_index"]),
                fitting,
                self.drive.session,
                round(float(self.drive.x[at.X_LINK]) / self.drive.link_step_v),
                is_running=self.drive.is_energised,
            )
        return self.window[skip : skip + count]


def status_values(drive: Firmware) -> dict[str, Any]:
    """Raw value of every read-only item, as it is now."""
    plate, identity = drive.plant.nameplate, drive.map.document["identity"]
    magnitude = drive.samples.largest_count() * drive.current_scale_a if drive.is_energised else 0.0
    left = drive.values["test_time_limit_s"] - drive.samples.c[at.C_PERIOD] * drive.p[at.P_PERIOD]
    values = {
        "magic": drive.setup.magic if drive.setup.magic is not None else identity["magic"],
        "map_version": identity["map_version"],
        "firmware_version": drive.setup.firmware,
        "serial_number": drive.setup.serial,
        "drive_type": drive.setup.drive_type or identity["drive_type"],
        "rated_drive_current_a": drive.setup.rated_current_a,
        "control_period_s": round(drive.p[at.P_PERIOD] / drive.map.items["control_period_s"].scale),
        "switching_frequency_hz": drive.plant.power_stage.switching_frequency_hz,
        "status_word": drive.status_word,
        "fault_code": int(drive.fault),
        "trip_cause": int(drive.trip_cause),
        "trip_value": drive.trip_value,
        "trip_limit": drive.trip_limit,
        "heartbeat_echo": drive.heartbeat_echo,
        "session_id": drive.session,
        "interlocks": drive.interlocks,
        "dc_link_v": drive.link_now(),
        "heatsink_degc": drive.heatsink_degc,
        "winding_degc": drive.winding_degc if drive.setup.has_winding_sensor else math.nan,
        "shaft_speed_rad_per_s": drive.setup.shaft_speed_rad_per_s,
        "current_magnitude_a": magnitude,
        "present_scale": drive.e[at.E_SCALE] if drive.is_energised else 0.0,
        "samples_produced": drive.produced,
        "overruns": min(drive.samples.overruns, 0xFFFF),
        "test_time_left_s": max(left, 0.0) if drive.is_energised else 0.0,
        "present_bias_v": drive.e[at.E_BIAS] if drive.is_energised else 0.0,
        "settings_count": drive.settings_count,
        "owner_left_s": drive.claim.left_s(drive.now()),
        "current_scale_a": drive.current_scale_a,
        "voltage_scale_v": VOLTAGE_STEP_V,
        "dc_link_scale_v": drive.link_step_v,
        "ring_capacity": drive.setup.ring_capacity,
        "current_full_scale_a": drive.plant.sensors.full_scale_a,
        "rated_power_w": plate.rated_power_w,
        "rated_voltage_v": plate.rated_voltage_v,
        "rated_frequency_hz": plate.rated_frequency_hz,
        "rated_current_a": plate.rated_current_a,
        "rated_speed_rpm": plate.rated_speed_rpm,
        "power_factor": plate.power_factor,
        "pole_pairs": plate.pole_pairs,
        "commit_result": drive.parameters.commit_result,
        "store_result": drive.parameters.store_result,
        "store_count": drive.memory.content["store_count"],
    }
    for j, name in enumerate(PARAMETERS):
        values[name] = drive.parameters.in_use[j]
        values["stored_" + name] = drive.memory.content["parameters"][j]
    return values
