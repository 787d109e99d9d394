"""What flows between the layers: plain frozen records, SI units, signals as `(n,)` float64 arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray


def plain_name(item: str) -> str:
    """`stator_resistance` as people say it."""
    return item.replace("_", " ")


_ENDINGS = (
    ("_rad_per_s", "rad/s"), ("_nm", "N m"), ("_percent", "%"), ("_hz", "Hz"), ("_db", "dB"), ("_var", "var"), ("_w", "W"), ("_v", "V"),
    ("_a", "A"),
)  # fmt: skip


def in_words(name: str) -> tuple[str, str]:
    """What it is and its unit: `load_torque_ripple_nm` as ("load torque ripple", "N m")."""
    for ending, unit in _ENDINGS:
        if name.endswith(ending):
            return plain_name(name.removesuffix(ending)), unit
    return plain_name(name), ""


def drive_words(drive_type: str, serial_number: int | None) -> str:
    """`SIM-INV-7A #4711`; a number that is not known is said to be so, never shown as 0."""
    return f"{drive_type}, serial number unknown" if serial_number is None else f"{drive_type} #{serial_number}"


Signal = NDArray[np.float64]
DiagnosisVerdict = Literal["explained", "nothing_significant", "not_distinguishable", "unexplained", "refused"]
"""What a diagnosis ends with, of a motor at rest or running, of samples or of test points."""


def peak(signal: Signal) -> float:
    """The largest magnitude; NaN where there is one."""
    return float(np.maximum.reduce(np.abs(signal), axis=None))


RPM = 30.0 / np.pi
"""1/min per rad/s."""
POINT_COLUMNS = ("frequency_hz", "voltage_line_v", "current_line_a", "power_w")
"""What a table of steady-state test points needs: line values rms, power of all three phases."""
WATT_METERS = ("power_1_w", "power_2_w", "power_3_w")
POINT_FORMS = ("voltage_neutral_v", "voltage_phase_v", "current_phase_a", *WATT_METERS, "power_phase_w", "power_factor")
"""What may stand in place of line values and of the power of all phases: volts to the neutral, of a phase; amperes of a phase; wattmeters, the
power of one phase, the power factor."""
DIRECT_TEST, IDLE_TEST, LOCKED_TEST, SINGLE_PHASE_TEST, LOAD_TEST = 0.0, 1.0, 2.0, 3.0, 4.0
"""In the column `test` of a test sheet; single phase: a locked rotor with such current; load: a turning motor with one."""
TERMINAL_PAIRS = ("winding_resistance_uv_ohm", "winding_resistance_vw_ohm", "winding_resistance_wu_ohm")
WINDINGS = ("winding_resistance_u_ohm", "winding_resistance_v_ohm", "winding_resistance_w_ohm")
POINT_RESISTANCES = (
    *TERMINAL_PAIRS,
    *WINDINGS,
    "winding_resistance_line_ohm",
    "terminal_resistance_ohm",
    "winding_resistance_phase_ohm",
    "winding_resistance_ohm",
    "phase_resistance_ohm",
    "stator_resistance_ohm",
    "resistance_ohm",
)
"""Names under which it may have the windings' resistance, at every point; what each holds: `diagnose.points.resistance`."""


@dataclass(frozen=True)
class SampleBlock:
    """One window of the stream as decoded from the drive: consecutive samples, no holes inside.

    `lost_before` counts the samples missing between the previous block and this one; they are never filled.
    `current_*_a[k]` is sampled at `(first_index + k) * sample_period_s`; `voltage_axis_v[k]` is the mean voltage
    commanded along the axis over the period that starts there. Where `averaged` > 1 control periods make a sample, all of
    its values are means over them (currents of the control periods' starts). `age_s`: how old the last sample can have been, at
    most, when it arrived (`safety.freshness`). `unit_v`, `unit_a`: of one of the drive's counts, where every value is a whole
    number of them (16 bits); 0: not known.
    """

    session: int
    first_index: int
    sample_period_s: float
    axis_deg: float
    voltage_axis_v: Signal
    current_u_a: Signal
    current_v_a: Signal
    current_w_a: Signal | None
    dc_link_v: float
    lost_before: int = 0
    clipped: bool = False
    age_s: float = 0.0
    averaged: int = 1
    unit_v: float = 0.0
    unit_a: float = 0.0

    @cached_property
    def count(self) -> int:
        return int(self.current_u_a.shape[0])

    def aged(self, age_s: float) -> SampleBlock:
        """The same samples, of this age: as `dataclasses.replace`, which takes as long as decoding them did."""
        block = object.__new__(type(self))
        block.__dict__.update(self.__dict__, age_s=age_s)
        return block


UNUSED_VOLTAGE = "unused_voltage"
"""Code of the note that a column in volts could not be used, where no other was."""
ONE_CURRENT = "one_current"
"""Code of the note that one current was recorded and stands for the three."""


@dataclass(frozen=True)
class ReadingNote:
    """What a reader changed in a recording, or left unused; `code` for programs, `what` for people."""

    code: str
    what: str


@dataclass(frozen=True)
class StandstillRecording:
    """A standstill recording in the contract's format. Missing samples are missing rows: `time_s` jumps.

    `segment` numbers stretches between which the motor was de-energised. `metadata` holds the contract's keys
    (`rated_power_w` ... `sample_period_s`) as they stood in the file. `averaged`: where rows are means, over how many of the
    sample periods each, which then are the drive's control periods; one number within a segment.
    """

    time_s: Signal
    segment: NDArray[np.int64]
    axis_deg: Signal
    voltage_axis_v: Signal
    current_u_a: Signal
    current_v_a: Signal
    current_w_a: Signal | None
    dc_link_v: Signal | None
    sample_period_s: float
    metadata: Mapping[str, float | str] = field(default_factory=dict)
    source: str = ""
    notes: tuple[ReadingNote, ...] = ()
    averaged: NDArray[np.int64] | None = None


@dataclass(frozen=True)
class RunningRecording:
    """A recording of a running motor. Voltages are `(n,)` each, phase (u, v, w) or line-to-line (uv, vw, wu)."""

    time_s: Signal
    currents_a: tuple[Signal, Signal, Signal]
    voltages_v: tuple[Signal, Signal, Signal]
    voltages_are_line_to_line: bool
    speed_rad_per_s: Signal | None
    sample_period_s: float
    metadata: Mapping[str, float | str] = field(default_factory=dict)
    source: str = ""
    notes: tuple[ReadingNote, ...] = ()


@dataclass(frozen=True)
class DriveIdentity:
    """Who answers at the other end of the wire. None, empty or NaN: the drive file knows no register for it.

    `drive_type` is then the drive file's name: what was assumed, not what answered.
    """

    drive_type: str
    serial_number: int | None
    firmware_version: str
    map_version: int | None
    rated_drive_current_a: float
    control_period_s: float
    switching_frequency_hz: float

    @property
    def words(self) -> str:
        """`SIM-INV-7A #4711`, or the type alone with what is not known of it."""
        return drive_words(self.drive_type, self.serial_number)


@dataclass(frozen=True)
class DriveStatus:
    """One reading of the drive's status. `state` is the decoded CiA 402 state, `interlocks` the named bits.
    `fault_code` None: the drive file knows no register for it."""

    state: str
    is_energised: bool
    fault_code: int | None
    fault_text: str
    trip_value: float
    trip_limit: float
    interlocks: Mapping[str, bool]
    dc_link_v: float
    heatsink_degc: float
    winding_degc: float
    shaft_speed_rad_per_s: float
    current_magnitude_a: float
    heartbeat_echo: int
    session: int
    trip_cause: int = 0
    trip_text: str = ""
    trip_unit: str = ""
    present_scale: float = 0.0
    present_bias_v: float = 0.0
    test_time_left_s: float = 0.0
    samples_produced: int = 0
    overruns: int = 0
    settings_count: int | None = None
    """Changes of a setting since power-up, whoever made them; None where the drive does not count them."""


@dataclass(frozen=True)
class ParameterSnapshot:
    """The drive's motor parameters as a run found them: in use and in non-volatile memory, by profile name; the plate that
    stood in the drive with them, and what else tuning changes. `store_count` None: the drive does not count."""

    identity: DriveIdentity
    in_use: Mapping[str, float]
    stored: Mapping[str, float]
    store_count: int | None
    plate: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class WrittenParameter:
    """One row of the contract's `written` list. `after`: what was written, rounded to the drive's own words."""

    name: str
    register: int
    before: float
    after: float
    read_back: float
