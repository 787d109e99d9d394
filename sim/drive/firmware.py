"""Firmware of the simulated drive: CiA 402 states, interlocks, supervision, excitation.

Time is the motor's: `advance(seconds)` runs the control interrupt while the output is on and lets the machine coast
while it is off. Nothing here knows a socket.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from sim.drive.claim import Claim
from sim.drive.drive_map import DriveMap, Item
from sim.drive.live import COUNTS_PER_LSB, crc16, run_interrupts
from sim.drive.memory import Memory
from sim.drive.parameters import ParameterSet
from sim.drive.samples import VOLTAGE_STEP_V, SampleRing, link_step_v
from sim.drive.states import Setup, State, Trip
from sim.physics import layout as at
from sim.physics.kernel import coast, scratch
from sim.physics.machine import COPPER_PER_K, Plant
from sim.physics.packing import fresh_state, pack
from sim.wire.state_log import StateLog

LARGEST_VOLTAGE_V = 320.0
CHUNK = 4096
LIVE = ("dc_bias_v", "bias_ramp_v_per_s", "amplitude_scale", "scale_ramp_per_s")


def warm_up(plant: Plant, drive_map: DriveMap) -> None:
    """Compile (or load) every kernel the drive uses, so that no first request waits for it."""
    p, s = pack(plant)
    x, e, ring = fresh_state(p), np.zeros(at.E_COUNT), SampleRing(drive_map, 16, 1, 1)
    e[[at.E_STEP_V, at.E_DURATION, at.E_TIME_LIMIT]] = 1.0
    white, trip = np.zeros((1, 4)), np.zeros(1)
    run_interrupts(1, x, p, e, s, ring.c, white, ring.history, ring.means, ring.ring, ring.flags, trip, scratch())
    coast(x, p, 0.001)
    crc16(np.zeros(1, np.int64))
    ring.window(0, 1, 0, 0, is_running=False)


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
        self.link_step_v = link_step_v(plant.power_stage.link_v)
        self.noise = np.random.default_rng([seed, 1])
        self.link_noise = np.random.default_rng([seed, 2])
        self.seed = seed
        self.first_energised_s: float | None = None
        self.before_command: Callable[[str], bool] = lambda command: False
        self.on_energised: list[Callable[[], None]] = []
        self.events: list[tuple[float, Callable[[], None]]] = []
        self._power_up()

    # --- power -----------------------------------------------------------------------------------------------

    def _power_up(self) -> None:
        self.values: dict[str, Any] = {n: self._blank(item) for n, item in self.map.items.items() if item.is_writable}
        self.values["decimation"], self.values["channel_mask"] = 1, 0b1111
        self.values["scale_ramp_per_s"], self.values["bias_ramp_v_per_s"] = 1.0, 20.0
        self.parameters = ParameterSet(self.values, self.map, self.setup, self.memory, self.log)
        self.claim, self.settings_count = Claim(self.values), 0
        self.state = State.SWITCH_ON_DISABLED
        self.fault = self.trip_cause = Trip.NONE
        self.trip_value = self.trip_limit = 0.0
        self.session = (self.memory.power_up() * 1009 + self.seed * 17) & 0x7FFF
        self.last_control = 0
        self.heartbeat_echo = 0
        self.fed_at = 0.0
        self._new_session()
        if not self.memory.is_intact:
            self._set_fault(Trip.MEMORY, 0.0, 0.0)
        elif self.setup.fault_at_start:
            self._set_fault(Trip(self.setup.fault_at_start), 0.0, 0.0)
        self.log.write("power_up", self.t, parameters=self.parameters.in_use, session=self.session)

    def power_off(self) -> None:
        """Mains off for good: the output is dead and the log says so."""
        self._block("power")

    def power_cycle(self) -> None:
        """Mains off and on: output dead at once, volatile values lost, parameters as stored."""
        self._block("power")
        coast(self.x, self.p, 1.0)
        self._power_up()

    def _blank(self, item: Item) -> Any:
        if item.kind == "ascii":
            return ""
        return [0] * item.length if item.length > 1 else 0

    def _new_session(self) -> None:
        v = self.values
        self.e, self.trip_current, self._work = np.zeros(at.E_COUNT), np.zeros(1), scratch()
        self.samples = SampleRing(self.map, self.setup.ring_capacity, v["channel_mask"], v["decimation"])

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
        return self.samples.produced

    def advance(self, seconds: float) -> None:
        """Let motor time pass: whole control periods while energised."""
        until = self.t + seconds
        while self.is_energised and self.t < until - 0.5 * self.p[at.P_PERIOD]:
            self._run(round((until - self.t) / self.p[at.P_PERIOD]))
        if not self.is_energised and self.t < until:
            coast(self.x, self.p, until - self.t)
        self._happen()
        self.settings_count = (self.settings_count + self.parameters.finish_due(self.t)) & 0xFFFF
        self.check_watchdog()

    def run_until_sample(self, index: int) -> None:
        """Let motor time pass until this many samples of the session exist, or it ended."""
        index = min(index, self.produced + self.setup.ring_capacity)
        while self.is_energised and self.produced < index:
            self._run(self.samples.periods_until(index))

    def _run(self, periods: int) -> None:
        periods = min(periods, CHUNK, self._periods_to_event())
        white = self.noise.standard_normal((periods, 4))
        ring = self.samples
        run_interrupts(
            periods, self.x, self.p, self.e, self.s, ring.c, white, ring.history, ring.means, ring.ring, ring.flags,
            self.trip_current, self._work,
        )  # fmt: skip
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
        stop = int(self.samples.c[at.C_STOP])
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
        hottest = max(self.x[at.X_HEAT_A : at.X_HEAT_C + 1].tolist())
        return self.setup.winding_degc + hottest / COPPER_PER_K

    @property
    def heatsink_degc(self) -> float:
        return self.setup.heatsink_degc

    # --- watchdog -------------------------------------------------------------------------------------------------

    def now(self) -> float:
        """Seconds of the clock that feeds watchdog and claim."""
        return self.wall_clock() if self.wall_clock else self.t

    def feed(self, value: int) -> None:
        """A heartbeat; only a changed one restarts the watchdog."""
        if value != self.heartbeat_echo and self.setup.heeds_heartbeat:
            self.heartbeat_echo = value
            self.fed_at = self.now()
            self.claim.renew(self.now())

    def check_watchdog(self) -> None:
        """Bite when due, whoever is or is not asking."""
        limit_ms = self.values["watchdog_ms"]
        silent_ms = (self.now() - self.fed_at) * 1e3
        if self.is_energised and limit_ms and silent_ms > limit_ms and not self.setup.runs_away:
            self.trip(Trip.WATCHDOG, silent_ms, float(limit_ms))

    def watchdog_due_in(self) -> float:
        """Seconds until the watchdog would bite, inf when it is not running."""
        if not self.is_energised or not self.values["watchdog_ms"] or self.setup.runs_away:
            return math.inf
        return self.fed_at + self.values["watchdog_ms"] / 1e3 - self.now()

    # --- states --------------------------------------------------------------------------------------------------

    def control(self, word: int) -> None:
        """CiA 402 control word: device control commands by their bit patterns."""
        if self.is_energised and self.setup.runs_away:
            return
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
        self.samples.has_ended = True
        until_zero = coast(self.x, self.p, 0.02)
        self._log_peaks()
        self.log.write(
            "de_energised",
            self.t,
            why=why,
            until_zero_s=until_zero,
            session=self.session,
            since_heartbeat_s=self.now() - self.fed_at,
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
        self._new_session()
        self.trip_cause, self.trip_value, self.trip_limit = Trip.NONE, 0.0, 0.0
        self._latch()
        self.x[at.X_PEAK_S] = self.x[at.X_PEAK_R] = self.x[at.X_PEAK_A] = 0.0
        self.samples.has_ended = False
        self.state = State.ENABLED
        self.fed_at = self.now()
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
        self.s[at.S_TRIP_A] = min(v["current_limit_a"], self.setup.hardware_current_limit_a)
        self.take_cuts()
        self._take_live()

    def take_cuts(self) -> None:
        """What this drive cuts off its output; its current limiter is stable at a fifth of the leakage's volts per ampere and period."""
        setup, e = self.setup, self.e
        e[at.E_LOST], e[at.E_MOST_V], e[at.E_MOST_A] = setup.lost_voltage, setup.most_voltage_v, setup.most_current_a
        e[at.E_FOLDBACK_OHM] = 0.2 * self.plant.machine.leakage_inductance_h / self.plant.control_period_s

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
        return float(round((self.x[at.X_LINK] + noise) / self.link_step_v) * self.link_step_v)

    @property
    def current_scale_a(self) -> float:
        """Of one count (A): the converter has the step that it has, a coarse one that was put in included."""
        return float(self.s[at.S_LSB_A]) / COUNTS_PER_LSB

    # --- what was written -------------------------------------------------------------------------------------------

    def take(self, name: str, value: Any) -> None:
        """Act on a register value that has passed every check."""
        if name not in ("heartbeat", "window_index", "echo"):
            self.log.write("write", self.t, item=name, value=value)
        if name in self.setup.ignores and name not in ("commit", "store"):
            return
        self.values[name] = value
        if name == "heartbeat":
            self.feed(value)
        elif name == "owner_token":
            self.claim.renew(self.now())
        elif name == "control_word":
            self.control(value)
        elif name in LIVE:
            self._take_live()
        elif value == self.map.document["commands"].get(name) and not self.before_command(name):
            self.parameters.begin(name, self.t)
