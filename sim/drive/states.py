"""Words of the drive: access answers, CiA 402 states, trips, and the facts a scenario sets it up with."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field


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
    runs_away: bool = False
    shaft_speed_rad_per_s: float = 0.0
    parameters: tuple[float, float, float, float] = (3.2, 1.8, 0.026, 0.200)
    commit_sticks: bool = False
    store_fails: bool = False
    ignores: frozenset[str] = frozenset()
    refuses: frozenset[str] = frozenset()
    ring_capacity: int = 16384
    lost_voltage: float = 0.0
    most_voltage_v: float = math.inf
    most_current_a: float = math.inf
