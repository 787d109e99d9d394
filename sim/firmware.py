"""Firmware of the simulated drive: CiA 402 states, interlocks, supervision, excitation, sample window, parameters.

Time is the motor's: `advance(seconds)` runs the control interrupt while the output is on and lets the machine coast
while it is off. Nothing here knows a socket. Registers are asked for with `read` and written with `write`; a refusal is
an `Answer`, whose value is the Modbus exception code.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from sim import layout as at
from sim.drive_map import DriveMap, Item
from sim.kernel import coast
from sim.live import CHANNELS, COUNTS_PER_LSB, HISTORY, crc16, run_interrupts
from sim.machine import COPPER_PER_K, Plant, fresh_state, pack
from sim.memory import Memory
from sim.state_log import StateLog

VOLTAGE_STEP_V = 0.01
LINK_STEP_V = 0.02
LARGEST_VOLTAGE_V = 320.0
CHUNK = 4096
COMMIT_S, STORE_S = 0.015, 0.060


class Answer(enum.Enum):
    """Outcome of a register access; the value is the Modbus exception code, 0 = none."""

    DONE = 0
    NO_SUCH_ADDRESS = 2
    BAD_VALUE = 3
    BUSY = 6


class State(enum.Enum):
    """CiA 402 states with their status word patterns (CiA 402-2, table of the state coding)."""

    SWITCH_ON_DISABLED = 0x0040
    READY = 0x0021
    SWITCHED_ON = 0x0023
    ENABLED = 0x0037
    FAULT = 0x0008


class Trip(enum.IntEnum):
    NONE = 0
    OVERCURRENT = 1
    HEATSINK = 2
    EARTH_FAULT = 3
    STO = 4
    UNDERVOLTAGE = 5
    WATCHDOG = 6
    TIME_LIMIT = 7
    WINDING = 8
    MEMORY = 9


@dataclass
class Setup:
    """Facts of the drive itself, from the scenario; faults change some of them while it runs."""

    serial: int = 20250117
    firmware: int = 0x00010203
    magic: int | None = None
    drive_type: str | None = None
    rated_current_a: float = 7.0
    hardware_current_limit_a: float = 14.0
    heatsink_degc: float = 32.0
    winding_degc: float = 24.0
    has_winding_sensor: bool = True
    interlocks: dict[str, bool] = field(default_factory=dict)
    fault_at_start: int = 0
    takes_watchdog: bool = True
    heeds_heartbeat: bool = True
    shaft_speed_rad_per_s: float = 0.0
    parameters: tuple[float, float, float, float] = (3.2, 1.8, 0.026, 0.200)
    commit_sticks: bool = False
    store_fails: bool = False
    ignores: frozenset[str] = frozenset()
    refuses: frozenset[str] = frozenset()
    ring_capacity: int = 16384


def warm_up(plant: Plant, capacity: int = 16) -> None:
    """Compile (or load) every kernel the drive uses, so that no first request waits for it."""
    p, s = pack(plant)
    c, e = np.zeros(at.C_COUNT, np.int64), np.zeros(at.E_COUNT)
    c[at.C_DECIMATION], e[at.E_STEP_V], e[at.E_DURATION], e[at.E_TIME_LIMIT] = 1, 1.0, 1.0, 1.0
    x, ring = fresh_state(p), np.zeros((capacity, CHANNELS), np.int16)
    run_interrupts(
        1,
        x,
        p,
        e,
        s,
        c,
        np.zeros((1, 4)),
        np.zeros((HISTORY, at.POINTS, 2)),
        np.zeros(CHANNELS),
        ring,
        np.zeros(capacity, np.uint8),
        np.zeros(1),
    )
    coast(x, p, 0.001)
    crc16(np.zeros(1, np.int64))


PARAMETERS = ("stator_resistance", "rotor_resistance", "leakage_inductance", "magnetizing_inductance")
PARAMETER_RANGE = ((1e-3, 1e3), (1e-3, 1e3), (1e-3, 1e3), (1e-2, 1e4))  # wire units: ohm, ohm, mH, mH


class Firmware:
    """One powered drive with its motor. `wall_clock` feeds the watchdog instead of motor time when given."""

    def __init__(
        self,
        plant: Plant,
        drive_map: DriveMap,
        setup: Setup,
        memory: Memory,
        seed: int,
        log: StateLog | None = None,
        wall_clock: Callable[[], float] | None = None,
    ) -> None:
        self.plant, self.map, self.setup, self.memory = plant, drive_map, setup, memory
        self.log = log or StateLog(None)
        self.wall_clock = wall_clock
        self.p, self.s = pack(plant)
        self.x = fresh_state(self.p)
        self.noise = np.random.default_rng([seed, 1])
        self.link_noise = np.random.default_rng([seed, 2])
        self.seed = seed
        self.first_energised_s: float | None = None
        self.before_command: Callable[[str], bool] = lambda command: False
        self.on_energised: list[Callable[[], None]] = []
        self.gaps: list[tuple[int, int]] = []
        self.events: list[tuple[float, Callable[[], None]]] = []
        self._power_up()

    # --- power -----------------------------------------------------------------------------------------------

    def _power_up(self) -> None:
        self.values: dict[str, Any] = {n: self._blank(item) for n, item in self.map.items.items() if item.is_writable}
        self.values["decimation"], self.values["channel_mask"] = 1, 0b1111
        self.values["scale_ramp_per_s"], self.values["bias_ramp_v_per_s"] = 1.0, 20.0
        stored = [float(v) for v in self.memory.content["parameters"]]
        self.in_use = list(stored)
        for name, value in zip(PARAMETERS, stored, strict=True):
            self.values["staged_" + name] = value
        self.state = State.SWITCH_ON_DISABLED
        self.fault = self.trip_cause = Trip.NONE
        self.trip_value = self.trip_limit = 0.0
        self.session = (self.memory.power_up() * 1009 + self.seed * 17) & 0x7FFF
        self.commit_result = self.store_result = 0
        self.commit_due = self.store_due = math.inf
        self.last_control = 0
        self.heartbeat_echo = 0
        self.fed_at = 0.0
        self.link_seen = self.p[at.P_LINK_V]
        self._new_session_buffers()
        if not self.memory.is_intact:
            self._set_fault(Trip.MEMORY, 0.0, 0.0)
        elif self.setup.fault_at_start:
            self._set_fault(Trip(self.setup.fault_at_start), 0.0, 0.0)
        self.log.write("power_up", self.t, parameters=self.in_use, session=self.session)

    def power_cycle(self) -> None:
        """Mains off and on: output dead at once, volatile values lost, parameters as stored."""
        self._block("power")
        coast(self.x, self.p, 1.0)
        self._power_up()

    def _blank(self, item: Item) -> Any:
        return [0] * item.length if item.length > 1 else 0

    def _new_session_buffers(self) -> None:
        capacity = self.setup.ring_capacity
        self.e, self.c = np.zeros(at.E_COUNT), np.zeros(at.C_COUNT, np.int64)
        self.history, self.means = np.zeros((HISTORY, at.POINTS, 2)), np.zeros(CHANNELS)
        self.ring, self.ring_flags = np.zeros((capacity, CHANNELS), np.int16), np.zeros(capacity, np.uint8)
        self.trip_current = np.zeros(1)
        self.next_unread = 0
        self.overruns = 0
        self.mask = self.values["channel_mask"] or 1
        self.stream_ended = True

    # --- time ---------------------------------------------------------------------------------------------------

    @property
    def t(self) -> float:
        """Motor time (s) since the simulation began."""
        return float(self.x[at.X_TIME])

    @property
    def is_energised(self) -> bool:
        return self.state is State.ENABLED

    @property
    def produced(self) -> int:
        return int(self.c[at.C_PRODUCED])

    def advance(self, seconds: float) -> None:
        """Let motor time pass: whole control periods while energised."""
        until = self.t + seconds
        while self.is_energised and self.t < until - 0.5 * self.p[at.P_PERIOD]:
            self._run(round((until - self.t) / self.p[at.P_PERIOD]))
        if not self.is_energised and self.t < until:
            coast(self.x, self.p, until - self.t)
        self._happen()
        self._finish_jobs()
        self._check_watchdog()

    def run_until_sample(self, index: int) -> None:
        """Let motor time pass until this many samples of the session exist, or it ended."""
        index = min(index, self.produced + self.setup.ring_capacity)
        while self.is_energised and self.produced < index:
            periods = (index - self.produced) * int(self.c[at.C_DECIMATION]) - int(self.c[at.C_IN_MEAN])
            self._run(periods)

    def _run(self, periods: int) -> None:
        periods = min(periods, CHUNK, self._periods_to_event())
        white = self.noise.standard_normal((periods, 4))
        run_interrupts(
            periods,
            self.x,
            self.p,
            self.e,
            self.s,
            self.c,
            white,
            self.history,
            self.means,
            self.ring,
            self.ring_flags,
            self.trip_current,
        )
        self._supervise()
        self._happen()

    def at(self, motor_time_s: float, event: Callable[[], None]) -> None:
        """Let something happen to the drive at a motor time, at a control period's boundary."""
        self.events.append((motor_time_s, event))
        self.events.sort(key=lambda entry: entry[0])

    def _periods_to_event(self) -> int:
        if not self.events:
            return CHUNK
        return max(1, math.ceil((self.events[0][0] - self.t) / self.p[at.P_PERIOD] - 1e-6))

    def _happen(self) -> None:
        while self.events and self.events[0][0] <= self.t + 1e-9:
            self.events.pop(0)[1]()

    def _supervise(self) -> None:
        """Trips and the regular end, after a stretch of control periods."""
        stop = int(self.c[at.C_STOP])
        if stop == at.STOP_OVERCURRENT:
            self.trip(Trip.OVERCURRENT, float(self.trip_current[0]), float(self.s[at.S_TRIP_A]))
        elif stop == at.STOP_TIME_LIMIT:
            limit = float(self.values["test_time_limit_s"])
            self.trip(Trip.TIME_LIMIT, limit, limit)
        elif stop == at.STOP_ENDED:
            self._leave(State.SWITCH_ON_DISABLED, "duration")
        limits = self.map.document["limits"]
        if self.is_energised and self.setup.has_winding_sensor and self.winding_degc > limits["winding_max_degc"]:
            self.trip(Trip.WINDING, self.winding_degc, limits["winding_max_degc"])
        if self.is_energised and self.heatsink_degc > limits["heatsink_max_degc"]:
            self.trip(Trip.HEATSINK, self.heatsink_degc, limits["heatsink_max_degc"])

    @property
    def winding_degc(self) -> float:
        hottest = float(np.max(self.x[at.X_HEAT_A : at.X_HEAT_C + 1]))
        return self.setup.winding_degc + hottest / COPPER_PER_K

    @property
    def heatsink_degc(self) -> float:
        return self.setup.heatsink_degc

    def _finish_jobs(self) -> None:
        if self.t >= self.commit_due:
            self.commit_due = math.inf
            self._finish_commit()
        if self.t >= self.store_due:
            self.store_due = math.inf
            self._finish_store()

    # --- watchdog -------------------------------------------------------------------------------------------------

    def _now(self) -> float:
        return self.wall_clock() if self.wall_clock else self.t

    def feed(self, value: int) -> None:
        """A heartbeat; only a changed one restarts the watchdog."""
        if value != self.heartbeat_echo and self.setup.heeds_heartbeat:
            self.heartbeat_echo = value
            self.fed_at = self._now()

    def _check_watchdog(self) -> None:
        limit_ms = self.values["watchdog_ms"]
        silent_ms = (self._now() - self.fed_at) * 1e3
        if self.is_energised and limit_ms and silent_ms > limit_ms:
            self.trip(Trip.WATCHDOG, silent_ms, float(limit_ms))

    def watchdog_due_in(self) -> float:
        """Seconds until the watchdog would bite, inf when it is not running."""
        if not self.is_energised or not self.values["watchdog_ms"]:
            return math.inf
        return self.fed_at + self.values["watchdog_ms"] / 1e3 - self._now()

    def check_watchdog_now(self) -> None:
        """For the server's own clock: bite when due, whoever is or is not asking."""
        self._check_watchdog()

    # --- states --------------------------------------------------------------------------------------------------

    def control(self, word: int) -> None:
        """CiA 402 control word: device control commands by their bit patterns."""
        reset = bool(word & 0x80) and not self.last_control & 0x80
        self.last_control = word
        if self.state is State.FAULT:
            if reset and not self.setup.interlocks.get("fault_stays", False):
                self.fault = Trip.NONE
                self._leave(State.SWITCH_ON_DISABLED, "fault reset")
            return
        if not word & 0x02 or not word & 0x04:
            self._leave(State.SWITCH_ON_DISABLED, "disable voltage" if not word & 0x02 else "quick stop")
        elif word & 0x07 == 0x06:
            self._leave(State.READY, "shutdown")
        elif word & 0x0F == 0x07 and self.state is not State.SWITCH_ON_DISABLED:
            self._leave(State.SWITCHED_ON, "switch on")
        elif word & 0x0F == 0x0F and self.state in (State.READY, State.SWITCHED_ON):
            self._leave(State.SWITCHED_ON, "switch on")
            self._enable()

    def _leave(self, state: State, why: str) -> None:
        if self.is_energised:
            self._block(why)
        if state is not self.state:
            self.state = state
            self.log.write("state", self.t, state=state.name, why=why)

    def _block(self, why: str) -> None:
        """The one place where the output is blocked: the diodes take the current down, the stream ends."""
        if not self.is_energised:
            return
        self.state = State.SWITCH_ON_DISABLED
        self.stream_ended = True
        until_zero = coast(self.x, self.p, 0.02)
        self._log_peaks()
        self.log.write(
            "de_energised",
            self.t,
            why=why,
            until_zero_s=until_zero,
            session=self.session,
            since_heartbeat_s=self._now() - self.fed_at,
            watchdog_ms=self.values["watchdog_ms"],
        )

    def _log_peaks(self) -> None:
        self.log.write(
            "peaks",
            self.t,
            session=self.session,
            stator_flux_wb=self.x[at.X_PEAK_S],
            rotor_flux_wb=self.x[at.X_PEAK_R],
            current_a=self.x[at.X_PEAK_A],
            rated_flux_wb=self.plant.nameplate.rated_flux_wb,
        )

    def trip(self, cause: Trip, value: float, limit: float) -> None:
        """Output off, fault state, cause kept with its value and limit."""
        self._block(f"trip {int(cause)}")
        self._set_fault(cause, value, limit)

    def _set_fault(self, cause: Trip, value: float, limit: float) -> None:
        self.state, self.fault = State.FAULT, cause
        self.trip_cause, self.trip_value, self.trip_limit = cause, value, limit
        self.log.write("trip", self.t, cause=int(cause), value=value, limit=limit)

    def refuses_enable(self) -> str:
        """Why the drive will not switch its output on; empty = it will."""
        v, limits = self.values, self.map.document["limits"]
        reasons = {
            "mode is not 1": v["mode"] != 1,
            "watchdog not set": not self.map.document["watchdog"]["min_ms"] <= v["watchdog_ms"],
            "an interlock is open": self.interlocks != self._all_interlocks(),
            "link out of range": not limits["dc_link_min_v"] <= self.link_now() <= limits["dc_link_max_v"],
            "no current limit": not v["current_limit_a"] > 0.0,
            "no test time limit": not v["test_time_limit_s"] > 0.0,
            "no voltage limit": not v["voltage_limit_v"] > 0.0,
            "no duration": not v["duration_s"] > 0.0,
            "no channel": not v["channel_mask"] & 0b1111,
            "decimation": not 1 <= v["decimation"] <= 100,
            "too hot": self.winding_degc > limits["winding_max_degc"]
            or self.heatsink_degc > limits["heatsink_max_degc"],
        }
        return next((reason for reason, holds in reasons.items() if holds), "")

    def _enable(self) -> None:
        refusal = self.refuses_enable()
        if refusal:
            self.log.write("enable_refused", self.t, why=refusal)
            return
        self.session = (self.session + 1) & 0xFFFF
        self._new_session_buffers()
        self.trip_cause, self.trip_value, self.trip_limit = Trip.NONE, 0.0, 0.0
        self._latch()
        self.x[at.X_PEAK_S] = self.x[at.X_PEAK_R] = self.x[at.X_PEAK_A] = 0.0
        self.stream_ended = False
        self.state = State.ENABLED
        self.fed_at = self._now()
        self.first_energised_s = self.t if self.first_energised_s is None else self.first_energised_s
        for hook in list(self.on_energised):
            hook()
        self.log.write(
            "energised",
            self.t,
            session=self.session,
            watchdog_ms=self.values["watchdog_ms"],
            axis_deg=self.values["axis_deg"],
            current_limit_a=self.values["current_limit_a"],
            voltage_limit_v=self.values["voltage_limit_v"],
        )

    def _latch(self) -> None:
        """Take axis, tones, limits and decimation as they are now; ramps begin at zero."""
        v, e = self.values, self.e
        e[at.E_AXIS_RAD] = math.radians(v["axis_deg"])
        e[at.E_LIMIT_V] = min(abs(v["voltage_limit_v"]), LARGEST_VOLTAGE_V)
        e[at.E_DURATION], e[at.E_TIME_LIMIT] = v["duration_s"], v["test_time_limit_s"]
        e[at.E_STEP_V], e[at.E_TONES] = VOLTAGE_STEP_V, v["tone_count"]
        tones = np.array(v["tones"], float).reshape(8, 3)
        e[at.E_AMPLITUDE : at.E_AMPLITUDE + 8] = tones[:, 0]
        e[at.E_FREQUENCY : at.E_FREQUENCY + 8] = tones[:, 1]
        e[at.E_PHASE : at.E_PHASE + 8] = tones[:, 2]
        self.c[at.C_DECIMATION] = v["decimation"]
        self.s[at.S_TRIP_A] = min(v["current_limit_a"], self.setup.hardware_current_limit_a)
        self._take_live()

    def _take_live(self) -> None:
        v, e = self.values, self.e
        e[at.E_BIAS_TARGET], e[at.E_BIAS_RAMP] = v["dc_bias_v"], abs(v["bias_ramp_v_per_s"])
        e[at.E_SCALE_TARGET], e[at.E_SCALE_RAMP] = v["amplitude_scale"], abs(v["scale_ramp_per_s"])

    # --- status ----------------------------------------------------------------------------------------------------

    def _all_interlocks(self) -> int:
        return sum(1 << bit for bit in self.map.document["interlock_bits"].values())

    @property
    def interlocks(self) -> int:
        closed = self.setup.interlocks
        return sum(1 << b for name, b in self.map.document["interlock_bits"].items() if closed.get(name, True))

    @property
    def status_word(self) -> int:
        remote = 0x0200 if self.setup.interlocks.get("remote_control", True) else 0
        voltage = 0x0010 if self.state in (State.READY, State.SWITCHED_ON, State.ENABLED) else 0
        return self.state.value | voltage | remote

    def link_now(self) -> float:
        """Measured DC link (V)."""
        noise = self.s[at.S_LINK_NOISE_V] * self.link_noise.standard_normal()
        return float(round((self.x[at.X_LINK] + noise) / LINK_STEP_V) * LINK_STEP_V)

    def _status_values(self) -> dict[str, Any]:
        plate, identity = self.plant.nameplate, self.map.document["identity"]
        last = (self.produced - 1) % self.setup.ring_capacity
        magnitude = float(np.max(np.abs(self.ring[last, 1:]))) * self.current_scale_a if self.is_energised else 0.0
        left = self.values["test_time_limit_s"] - self.c[at.C_PERIOD] * self.p[at.P_PERIOD]
        values = {
            "magic": self.setup.magic if self.setup.magic is not None else identity["magic"],
            "map_version": identity["map_version"],
            "firmware_version": self.setup.firmware,
            "serial_number": self.setup.serial,
            "drive_type": self.setup.drive_type or identity["drive_type"],
            "rated_drive_current_a": self.setup.rated_current_a,
            "control_period_s": round(self.p[at.P_PERIOD] / self.map.items["control_period_s"].scale),
            "switching_frequency_hz": self.plant.power_stage.switching_frequency_hz,
            "status_word": self.status_word,
            "fault_code": int(self.fault),
            "trip_cause": int(self.trip_cause),
            "trip_value": self.trip_value,
            "trip_limit": self.trip_limit,
            "heartbeat_echo": self.heartbeat_echo,
            "session_id": self.session,
            "interlocks": self.interlocks,
            "dc_link_v": self.link_now(),
            "heatsink_degc": self.heatsink_degc,
            "winding_degc": self.winding_degc if self.setup.has_winding_sensor else math.nan,
            "shaft_speed_rad_per_s": self.setup.shaft_speed_rad_per_s,
            "current_magnitude_a": magnitude,
            "present_scale": self.e[at.E_SCALE] if self.is_energised else 0.0,
            "samples_produced": self.produced,
            "overruns": min(self.overruns, 0xFFFF),
            "test_time_left_s": max(left, 0.0) if self.is_energised else 0.0,
            "present_bias_v": self.e[at.E_BIAS] if self.is_energised else 0.0,
            "current_scale_a": self.current_scale_a,
            "voltage_scale_v": VOLTAGE_STEP_V,
            "dc_link_scale_v": LINK_STEP_V,
            "ring_capacity": self.setup.ring_capacity,
            "current_full_scale_a": self.plant.sensors.full_scale_a,
            "rated_power_w": plate.rated_power_w,
            "rated_voltage_v": plate.rated_voltage_v,
            "rated_frequency_hz": plate.rated_frequency_hz,
            "rated_current_a": plate.rated_current_a,
            "rated_speed_rpm": plate.rated_speed_rpm,
            "power_factor": plate.power_factor,
            "pole_pairs": plate.pole_pairs,
            "commit_result": self.commit_result,
            "store_result": self.store_result,
            "store_count": self.memory.content["store_count"],
        }
        for j, name in enumerate(PARAMETERS):
            values[name] = self.in_use[j]
            values["stored_" + name] = self.memory.content["parameters"][j]
        return values

    @property
    def current_scale_a(self) -> float:
        return self.plant.sensors.lsb_a / COUNTS_PER_LSB

    # --- registers -------------------------------------------------------------------------------------------------

    def read(self, address: int, count: int) -> list[int] | Answer:
        """Words of any run of mapped registers; the window is built when its first register is asked for."""
        first = self.map.window_address
        if first <= address < first + self.map.window_words:
            return self._read_window(address - first, count)
        words: list[int] = []
        status = self._status_values()
        while len(words) < count:
            item = self.map.by_address.get(address + len(words))
            if item is None:
                return Answer.NO_SUCH_ADDRESS
            skip = address + len(words) - item.address
            value = self.values[item.name] if item.is_writable else status[item.name]
            words += item.encode(value)[skip : skip + count - len(words)]
        return words

    def write(self, address: int, words: list[int]) -> Answer:
        """All items of the request or none: existence, access, state and range are checked before any is changed."""
        changes: list[tuple[Item, Any]] = []
        at_word = 0
        while at_word < len(words):
            item = self.map.by_address.get(address + at_word)
            if item is None or not item.is_writable:
                return Answer.NO_SUCH_ADDRESS
            value, used = self._value_written(item, address + at_word - item.address, words[at_word:])
            if used == 0:
                return Answer.NO_SUCH_ADDRESS
            if item.needs_stop and self.is_energised:
                self.log.write("write_refused", self.t, item=item.name)
                return Answer.BUSY
            if not self._is_allowed(item, value):
                return Answer.BAD_VALUE
            changes.append((item, value))
            at_word += used
        for item, value in sorted(changes, key=lambda change: change[0].name == "control_word"):
            self._take(item, value)
        return Answer.DONE

    def _value_written(self, item: Item, skip: int, words: list[int]) -> tuple[Any, int]:
        """(value, words used); arrays may be written in part, value by value; a number never by half."""
        if skip % item.words_each or len(words) < min(item.words_each, item.words - skip):
            return None, 0
        used = min(item.words - skip, len(words) - len(words) % item.words_each)
        present = item.encode(self.values[item.name])
        present[skip : skip + used] = words[:used]
        return item.decode(present), used

    def _is_allowed(self, item: Item, value: Any) -> bool:
        if not item.accepts(value) or item.name in self.setup.refuses:
            return False
        if item.name == "watchdog_ms":
            return self.setup.takes_watchdog and (value == 0 or value >= self.map.document["watchdog"]["min_ms"])
        if item.name == "amplitude_scale":
            return 0.0 <= value <= 1.0
        if item.name in ("scale_ramp_per_s", "bias_ramp_v_per_s", "duration_s", "current_limit_a", "voltage_limit_v"):
            return value >= 0.0
        return True

    def _take(self, item: Item, value: Any) -> None:
        name = item.name
        if name not in ("heartbeat", "window_index", "echo"):
            self.log.write("write", self.t, item=name, value=value)
        if name in self.setup.ignores:
            return
        self.values[name] = value
        if name == "heartbeat":
            self.feed(value)
        elif name == "control_word":
            self.control(value)
        elif name in ("dc_bias_v", "bias_ramp_v_per_s", "amplitude_scale", "scale_ramp_per_s"):
            self._take_live()
        elif name in ("commit", "store") and value == self.map.document["commands"][name]:
            self._begin_job(name)

    def _begin_job(self, name: str) -> None:
        """Commit and store take their time; a fault may come in between."""
        if self.before_command(name):
            return
        if name == "commit":
            self.commit_result, self.commit_due = 1, math.inf if self.setup.commit_sticks else self.t + COMMIT_S
        else:
            self.store_result, self.store_due = 1, self.t + STORE_S

    # --- parameters ------------------------------------------------------------------------------------------------

    def _staged(self) -> list[float]:
        return [float(self.values["staged_" + name]) for name in PARAMETERS]

    def _finish_commit(self) -> None:
        self.values["commit"] = 0
        staged = self._staged()
        words = [
            w for name, v in zip(PARAMETERS, staged, strict=True) for w in self.map.items["staged_" + name].encode(v)
        ]
        if crc16(np.array(words)) != self.values["staged_crc"]:
            self.commit_result = 3
        elif not all(lo <= v <= hi for v, (lo, hi) in zip(staged, PARAMETER_RANGE, strict=True)):
            self.commit_result = 4
        else:
            self.commit_result = 2
            if "commit" not in self.setup.ignores:
                self.in_use = staged
        self.log.write("commit", self.t, result=self.commit_result, in_use=self.in_use)

    def _finish_store(self) -> None:
        self.values["store"] = 0
        if self.setup.store_fails:
            self.memory.wear()
            self.store_result = 3
        else:
            self.memory.store(list(self.in_use))
            self.store_result = 2
        self.log.write(
            "store",
            self.t,
            result=self.store_result,
            stored=self.memory.content["parameters"],
            store_count=self.memory.content["store_count"],
        )

    # --- sample window ----------------------------------------------------------------------------------------------

    @property
    def channels(self) -> list[int]:
        return [k for k in range(CHANNELS) if self.mask >> k & 1]

    def window_samples(self, registers: int) -> int:
        """Samples that fit a read of this many registers from the window's start."""
        data = min(registers, self.map.window_words) - self.map.window_header_words
        return max(data, 0) // len(self.channels)

    def _read_window(self, skip: int, count: int) -> list[int] | Answer:
        if skip + count > self.map.window_words:
            return Answer.NO_SUCH_ADDRESS
        if skip == 0:
            self.window = self.build_window(self.window_samples(count))
        words = getattr(self, "window", None) or self.build_window(0)
        return words[skip : skip + count]

    def build_window(self, samples: int) -> list[int]:
        """Header, CRC and data from `window_index` on; the oldest kept sample instead where that one is gone."""
        wanted = int(self.values["window_index"])
        oldest = max(0, self.produced - self.setup.ring_capacity)
        self.overruns += max(0, oldest - self.next_unread)
        self.next_unread = max(self.next_unread, oldest)
        first = max(wanted, oldest)
        count = max(0, min(samples, self.produced - first))
        first, count = self._around_gaps(first, count)
        flags = self._window_flags(first, count, was_overrun=wanted < oldest)
        self.next_unread = max(self.next_unread, first + count)
        link = round(self.x[at.X_LINK] / LINK_STEP_V)
        header = [self.session, first >> 16 & 0xFFFF, first & 0xFFFF, count, self.mask, flags, link & 0xFFFF]
        data = self._window_data(first, count)
        crc = int(crc16(np.concatenate([np.array(header, np.int64), data])))
        words = [*header, crc, *data.tolist()]
        return words + [0] * (self.map.window_words - len(words))

    def _around_gaps(self, first: int, count: int) -> tuple[int, int]:
        """Fault knob: samples the drive lost; a window ends before them or starts behind them."""
        for start, length in self.gaps:
            if start <= first < start + length:
                count, first = max(0, first + count - start - length), start + length
            elif first < start < first + count:
                count = start - first
        return first, min(count, max(0, self.produced - first))

    def _window_data(self, first: int, count: int) -> np.ndarray:
        rows = np.arange(first, first + count) % self.setup.ring_capacity
        return (self.ring[rows][:, self.channels].astype(np.int64) & 0xFFFF).reshape(-1)

    def _window_flags(self, first: int, count: int, *, was_overrun: bool) -> int:
        rows = np.arange(first, first + count) % self.setup.ring_capacity
        flags = int(np.bitwise_or.reduce(self.ring_flags[rows], initial=0))
        names = self.map.flags
        flags |= names["running"] * self.is_energised | names["overrun"] * was_overrun
        return flags | names["ended"] * (self.stream_ended and first + count >= self.produced)
