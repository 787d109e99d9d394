"""A drive without a socket: answers the commands of a course from a linear machine and a script of mishaps.

The machine is stepped by scipy's exact discretisation of the two state equations, so a course can be judged against the
parameters put in here.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from scipy.signal import cont2discrete

from commissioner.records import DriveIdentity, DriveStatus, ParameterSnapshot, SampleBlock, WrittenParameter
from commissioner.safety import commands as ask

PERIOD_S = 2e-4
BLOCK = 29
INTERLOCKS = {
    "sto_released": True, "remote_control": True, "shaft_at_rest": True, "supply_ok": True, "no_other_master": True,
}  # fmt: skip


@dataclass
class Machine:
    """R_s, R_R, L_sigma, L_M; the answer key."""

    r_s: float = 3.7
    r_r: float = 2.1
    l_sigma: float = 0.021
    l_m: float = 0.224

    def matrices(self) -> tuple[np.ndarray, np.ndarray]:
        alpha = self.r_r / self.l_m
        a = np.array([[-(self.r_s + self.r_r) / self.l_sigma, alpha / self.l_sigma], [self.r_r, -alpha]])
        b = np.array([[1 / self.l_sigma], [0.0]])
        ad, bd, *_ = cont2discrete((a, b, np.eye(2), np.zeros((2, 1))), PERIOD_S)
        return ad, bd[:, 0]


@dataclass
class ScriptedDrive:
    """`status` overrides fields of every status; `before` is called with each command and may raise."""

    machine: Machine = field(default_factory=Machine)
    noise_a: float = 0.01
    rated_a: float = 7.0
    seed: int = 1
    status: Mapping[str, Any] = field(default_factory=dict)
    plate: Mapping[str, float] = field(default_factory=dict)
    before: Callable[[ask.Command, ScriptedDrive], None] | None = None
    lose: Callable[[int], int] = lambda index: 0
    sent: list[ask.Command] = field(default_factory=list)
    told: list[object] = field(default_factory=list)
    is_energised: bool = False
    peak_flux_wb: float = 0.0
    energised_s: float = 0.0

    def __post_init__(self) -> None:
        self._rng = np.random.default_rng(self.seed)
        self._ad, self._bd = self.machine.matrices()
        self._session = 0
        self._loaded: ask.LoadExcitation | None = None
        self._x = np.zeros(2)

    def run(self, course: Generator[ask.Command, Any, Any]) -> Any:
        """Carry the course out; its return value. What the course raises passes through."""
        reply: object = None
        while True:
            try:
                command = course.send(reply)
            except StopIteration as stop:
                return stop.value
            self.sent.append(command)
            if self.before is not None:
                self.before(command, self)
            reply = self._answer(command)

    def _answer(self, command: ask.Command) -> object:
        match command:
            case ask.Identify():
                return self._identity()
            case ask.ReadStatus():
                return self._status()
            case ask.ReadNameplate():
                return self.plate
            case ask.TakeSnapshot():
                held = {"stator_resistance": 3.2, "rotor_resistance": 1.8, "leakage_inductance": 0.026}
                held["magnetizing_inductance"] = 0.2
                return ParameterSnapshot(self._identity(), held, held, 0)
            case ask.LoadExcitation():
                self._loaded = command
            case ask.Enable():
                self._start()
            case ask.SetScale(scale=scale):
                self._scale_target = scale
            case ask.SetBias(bias_v=bias):
                self._bias_target = bias
            case ask.Fetch():
                return self._fetch()
            case ask.Disarm():
                self.is_energised = False
            case ask.Tell(record=record):
                self.told.append(record)
            case ask.WriteParameters(circuit=circuit):
                return tuple(WrittenParameter(n, 0, 0.0, v, v) for n, v in asdict(circuit).items())
        return None

    def _start(self) -> None:
        assert self._loaded is not None
        self.is_energised, self._index, self._x = True, 0, np.zeros(2)
        self._session += 1
        self._scale = self._scale_target = self._bias = self._bias_target = 0.0

    def _fetch(self) -> SampleBlock | None:
        load = self._loaded
        assert load is not None
        assert self.is_energised, "a fetch while nothing is energised"
        if self._index * PERIOD_S >= load.duration_s:
            self.is_energised = False
            return None
        lost = self.lose(self._index)
        for _ in range(lost):
            self._step(load)
        first = self._index
        rows = [self._step(load) for _ in range(BLOCK)]
        voltage, current = (np.array(column) for column in zip(*rows, strict=True))
        noise = self.noise_a * self._rng.standard_normal((3, BLOCK))
        cosines = [np.cos(np.deg2rad(load.axis_deg - shift)) for shift in (0.0, 120.0, 240.0)]
        u, v, w = (c * current + n for c, n in zip(cosines, noise, strict=True))
        return SampleBlock(
            session=self._session, first_index=first, sample_period_s=PERIOD_S, axis_deg=load.axis_deg,
            voltage_axis_v=voltage, current_u_a=u, current_v_a=v, current_w_a=w, dc_link_v=540.0, lost_before=lost,
        )  # fmt: skip

    def _step(self, load: ask.LoadExcitation) -> tuple[float, float]:
        self._scale += np.clip(
            self._scale_target - self._scale, -load.scale_ramp_per_s * PERIOD_S, load.scale_ramp_per_s * PERIOD_S
        )
        self._bias += np.clip(
            self._bias_target - self._bias, -load.bias_ramp_v_per_s * PERIOD_S, load.bias_ramp_v_per_s * PERIOD_S
        )
        t = self._index * PERIOD_S
        tones = sum(a * np.cos(2 * np.pi * f * t + p) for a, f, p in load.tones)
        voltage, current = self._bias + self._scale * tones, self._x[0]
        self._x = self._ad @ self._x + self._bd * voltage
        self.peak_flux_wb = max(self.peak_flux_wb, abs(self._x[1] + self.machine.l_sigma * self._x[0]))
        self._index += 1
        self.energised_s += PERIOD_S
        return float(voltage), float(current)

    def _identity(self) -> DriveIdentity:
        return DriveIdentity("SCRIPTED", 1, "1.0.0", 1, self.rated_a, PERIOD_S, 5000.0)

    def _status(self) -> DriveStatus:
        held: dict[str, Any] = {
            "state": "switch-on disabled", "is_energised": self.is_energised, "fault_code": 0, "fault_text": "none",
            "trip_value": 0.0, "trip_limit": 0.0, "interlocks": INTERLOCKS, "dc_link_v": 540.0, "heatsink_degc": 40.0,
            "winding_degc": float("nan"), "shaft_speed_rad_per_s": 0.0, "current_magnitude_a": 0.0, "heartbeat_echo": 0,
            "session": self._session,
        }  # fmt: skip
        return DriveStatus(**(held | dict(self.status)))
