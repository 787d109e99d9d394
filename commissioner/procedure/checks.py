"""The checks before anything is energised: each a value with what was seen, what was expected and the remedy."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass

from commissioner.errors import CheckFailed
from commissioner.motor.nameplate import Nameplate
from commissioner.procedure.link_plan import LONGEST_REQUEST_S, StreamPace, least_baud, plan_link
from commissioner.records import DriveIdentity, DriveStatus
from commissioner.registers.misread import misread
from commissioner.registers.status import DriveState

NAMEPLATE_TOLERANCE = 0.05
"""A drive whose own plate differs by more than this from the job's motor is set up for another motor."""
DC_LINK_RIPPLE = 0.02
"""Largest change of the link voltage between two readings that still counts as steady."""
UNEVEN = 2.0
"""Of the fastest read of a window: a slower one is told."""
REST_SPEED_RAD_PER_S = 0.5


UNITS: Mapping[str, tuple[str, int]] = {
    "DC link in range": ("V", 1), "heatsink temperature": ("°C", 0), "winding temperature": ("°C", 0),
    "drive rated for the test current": ("A", 2), "rated power in the drive": ("W", 0), "rated voltage in the drive": ("V", 0),
    "rated frequency in the drive": ("Hz", 0), "rated current in the drive": ("A", 1), "rated speed in the drive": ("1/min", 0),
    "power factor in the drive": ("", 2), "pole pairs in the drive": ("", 0), "shaft at rest over the dwell time": ("rad/s", 1),
}  # fmt: skip
"""Of what a check sees, by the check's plain name; and its decimals where a page shows it."""


@dataclass(frozen=True)
class CheckResult:
    name: str
    has_passed: bool
    value: object
    limit: object
    remedy: str


@dataclass(frozen=True)
class NotChecked:
    """What could not be judged, and why: a drive file that does not know it, never a pass."""

    name: str
    why: str


@dataclass(frozen=True)
class DriveLimits:
    """What the drive's profile says about its own operating range."""

    dc_link_min_v: float
    dc_link_max_v: float
    heatsink_max_degc: float
    winding_max_degc: float


UNITS_OF_KEYS = ("w", "v", "hz", "a", "rpm", "s", "ms", "wb", "degc", "percent", "counts")
"""By which a drive file's keys end; the value beside the check's name has it, and counts have none."""
SMALLEST_DRIVE = 0.9
"""Peak rated current of the drive, of the test current: on a smaller drive tests aim lower (`Findings.test_current_a`)."""

FAR_TOO_SMALL = 0.3
"""Of the test current, the peak current of a drive that nobody puts in front of such a motor: its register is misread."""
COLDEST_DEGC, NO_SENSOR_LIVES_DEGC = -25.0, 250.0
"""What a drive in operation may show, and what none outlives, so that its register is misread."""


def check_failed(results: Sequence[CheckResult]) -> CheckFailed | None:
    """The first check that failed, as the error that it is."""
    first = next((result for result in results if not result.has_passed), None)
    if first is None:
        return None
    return CheckFailed(
        f"check failed: {first.name}", step="check", value=first.value, limit=first.limit, remedy=first.remedy,
        unit=check_unit(first.name),
    )  # fmt: skip


def check_name(check: str) -> str:
    """`rated_power_w in the drive` -> `rated power in the drive`: no key, and no unit in the name."""
    plain = re.sub(r", deg[A-Z]$", "", check)
    return re.sub(rf"_({'|'.join(UNITS_OF_KEYS)})( in the drive)$", r"\2", plain).replace("_", " ")


def check_unit(check: str) -> str:
    return UNITS.get(check_name(check), ("", 0))[0]


def judge_drive(
    identity: DriveIdentity,
    statuses: Sequence[DriveStatus],
    drive_nameplate: Mapping[str, float],
    nameplate: Nameplate,
    limits: DriveLimits,
    test_current_a: float,
    pace: StreamPace | None = None,
) -> tuple[CheckResult, ...]:
    """All checks that need no write. `statuses` are readings spread over the standstill dwell time, oldest first; `pace`
    None where it was not measured."""
    last = statuses[-1]
    return (
        *_stopped(last),
        *_interlocks(last),
        _at_rest(statuses),
        *_dc_link(statuses, limits),
        _below(
            "heatsink temperature, degC",
            "heatsink_degc",
            last.heatsink_degc,
            limits.heatsink_max_degc,
            "let the drive cool down",
        ),
        _below(
            "winding temperature, degC",
            "winding_degc",
            last.winding_degc,
            limits.winding_max_degc,
            "let the motor cool down",
        ),
        CheckResult(
            "drive rated for the test current",
            identity.rated_drive_current_a * math.sqrt(2) >= SMALLEST_DRIVE * test_current_a,
            round(identity.rated_drive_current_a * math.sqrt(2), 3),
            f"at least {SMALLEST_DRIVE * test_current_a:.3g} A peak",
            _remedy("lower limits.current_fraction or use a larger drive", _foreign_drive(identity, test_current_a)),
        ),
        *keeps_up(pace, identity.control_period_s),
        *_same_motor(drive_nameplate, nameplate),
    )


def judge_idle(
    status: DriveStatus | None, drive_nameplate: Mapping[str, float], nameplate: Nameplate
) -> tuple[CheckResult, ...]:
    """What must hold of a drive that is read or written and never energised. None: its file describes no status."""
    shown = () if status is None else (*_stopped(status), *_interlocks(status))
    return (*shown, *_same_motor(drive_nameplate, nameplate))


def _stopped(status: DriveStatus) -> Iterator[CheckResult]:
    has_fault = bool(status.fault_code) or status.state == DriveState.FAULT.value
    seen = status.fault_text if status.fault_code else status.state if has_fault else "none"
    yield CheckResult("no fault", not has_fault, seen, "none", "remove the cause, then reset the fault at the drive")
    remedy = "stop the drive: another master has enabled it"
    yield CheckResult("output off", not status.is_energised, status.state, "not enabled", remedy)


_INTERLOCKS = {
    "sto_released": ("safe torque off is released", "close the STO circuit; make sure nobody is at the machine"),
    "remote_control": ("control is remote and ours", "switch the drive to remote (bus) control"),
    "shaft_at_rest": ("the drive sees the shaft at rest", "wait until the shaft stands still"),
    "supply_ok": ("the supply is present", "switch the supply on"),
    "no_other_master": ("no other master holds the drive", "disconnect the other master or PLC"),
}


def _interlocks(status: DriveStatus) -> Iterator[CheckResult]:
    for bit, is_set in status.interlocks.items():
        name, remedy = _INTERLOCKS.get(bit, (bit.replace("_", " "), f"close the interlock {bit}"))
        yield CheckResult(name, is_set, "yes" if is_set else "no", "yes", remedy)


def _at_rest(statuses: Sequence[DriveStatus]) -> CheckResult:
    speeds = [abs(status.shaft_speed_rad_per_s) for status in statuses]
    fastest = max(speeds, key=lambda speed: math.inf if math.isnan(speed) else speed)
    return CheckResult(
        "shaft at rest over the dwell time",
        fastest <= REST_SPEED_RAD_PER_S,
        round(fastest, 3) if math.isfinite(fastest) else "not a number",
        f"at most {REST_SPEED_RAD_PER_S} rad/s",
        "stop whatever turns the shaft",
    )


def _dc_link(statuses: Sequence[DriveStatus], limits: DriveLimits) -> Iterator[CheckResult]:
    volts = [status.dc_link_v for status in statuses]
    outside_v = [max(limits.dc_link_min_v - v, v - limits.dc_link_max_v, 0.0) for v in volts]
    in_range = not any(outside > 0.0 or math.isnan(v) for outside, v in zip(outside_v, volts, strict=True))
    shown_v = volts[-1] if in_range else volts[outside_v.index(max(outside_v))]
    yield CheckResult(
        "DC link in range",
        in_range,
        round(shown_v, 1 if in_range else 3),
        f"{limits.dc_link_min_v:g} ... {limits.dc_link_max_v:g} V",
        _remedy(
            "check the supply voltage and the pre-charge",
            misread("dc_link_v", shown_v, limits.dc_link_min_v, limits.dc_link_max_v, "V"),
        ),
    )
    change = (max(volts) - min(volts)) / max(abs(volts[-1]), 1.0)
    yield CheckResult(
        "DC link steady",
        change <= DC_LINK_RIPPLE,
        f"{change:.2%}",
        f"at most {DC_LINK_RIPPLE:.0%}",
        "wait until the link has charged",
    )


def keeps_up(pace: StreamPace | None, sample_period_s: float) -> Iterator[CheckResult]:
    """One window is asked for at a time: where it takes longer than its samples last, a sample must be less, or kept in the
    drive (`link_plan`)."""
    if pace is None:
        return
    plan = plan_link(pace, sample_period_s)
    is_kept = plan is None or pace.is_kept(plan, sample_period_s)
    lasts_s, most_s = pace.samples * sample_period_s, pace.whole_s(sample_period_s)
    if not most_s < pace.round_trip_s <= lasts_s:
        most_s = lasts_s  # as runs have archived it
    took = [f"{1e3 * pace.round_trip_s:.3g} ms for {pace.samples} samples"]
    if pace.slowest_s > UNEVEN * pace.round_trip_s:
        took.append(f"{1e3 * pace.slowest_s:.3g} ms at worst")
    if not pace.can_steer:
        took.append(f"{1e3 * pace.request_s:.3g} ms for the shortest request")
    limit = [f"at most {1e3 * most_s:.3g} ms: the drive takes {1.0 / sample_period_s:.0f} samples a second"]
    if plan is not None and plan.is_reduced:
        took.append(plan.sentence(sample_period_s))
    if plan is None or plan.is_reduced:
        limit += [
            "slower with means, or with samples kept in the drive",
            f"{1e3 * LONGEST_REQUEST_S:.3g} ms for a short request",
        ]
    yield CheckResult(
        "the link keeps up with the samples",
        plan is not None and is_kept,
        "; ".join(took),
        "; ".join(limit),
        "use a link that answers sooner and evenly: a cable in place of radio, VPN or gateway; a serial line of "
        f"{least_baud(pace, sample_period_s, is_reduced=plan is None):.0f} Bd or more",
    )


def _below(name: str, key: str, value: float, limit: float, remedy: str) -> CheckResult:
    """NaN means that no sensor is fitted, which is not a failure."""
    return CheckResult(
        name,
        math.isnan(value) or value <= limit,
        "no sensor" if math.isnan(value) else round(value, 1),
        f"at most {limit:g} °C" if math.isfinite(limit) else "no limit known",
        _remedy(remedy, misread(key, value, COLDEST_DEGC, limit, "°C") if value > NO_SENSOR_LIVES_DEGC else ""),
    )


def _foreign_drive(identity: DriveIdentity, test_current_a: float) -> str:
    """What to try where the drive says that it is far too small for its motor."""
    rated_a = identity.rated_drive_current_a
    if rated_a * math.sqrt(2) >= FAR_TOO_SMALL * test_current_a:
        return ""
    return misread("rated_drive_current_a", rated_a, test_current_a / 2.0, 3.0 * test_current_a, "A")


def _remedy(usual: str, misreading: str) -> str:
    return f"{usual}; {misreading}" if misreading else usual


def _same_motor(drive_nameplate: Mapping[str, float], nameplate: Nameplate) -> Iterator[CheckResult]:
    """A drive without a plate (zeros) says nothing; one with another plate is set up for another motor."""
    expected = asdict(nameplate)
    seen = {key: value for key, value in drive_nameplate.items() if key in expected and value > 0}
    for key, value in seen.items():
        wanted = float(expected[key])
        yield CheckResult(
            f"{key} in the drive",
            abs(value - wanted) <= NAMEPLATE_TOLERANCE * wanted,
            round(value, 4),
            f"{wanted:g} within {NAMEPLATE_TOLERANCE:.0%}",
            _remedy(
                f"check which motor is connected; correct --motor or the drive's {key}",
                misread(key, value, wanted * (1.0 - NAMEPLATE_TOLERANCE), wanted * (1.0 + NAMEPLATE_TOLERANCE)),
            ),
        )
