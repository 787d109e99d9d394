"""Must we stop? Judged on every block and every status, independent of the procedure's own flux guard."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from commissioner.errors import Aborted, DriveFault
from commissioner.records import DriveStatus, SampleBlock, peak

TOO_LATE = "the samples came too late"
AFTER_OVER_CURRENT = (
    "check the connection (wired in delta for star a motor draws up to three times), the cable and the current sensors' scale, reset the fault "
    "at the drive, start again"
)


@dataclass(frozen=True)
class StopReason:
    """Why the test must end now. `is_fault`: the drive or the data failed; otherwise a guard acted. `unit`: of value and limit where they
    are numbers."""

    what: str
    value: float | str
    limit: float | str
    remedy: str
    is_fault: bool = False
    unit: str = ""


@dataclass(frozen=True)
class WatchLimits:
    """Peak values; `flux_fraction` is of the rated stator flux and lies above the procedure's guard. `age_s`: a motor whose
    newest sample is older runs unsupervised for as long as the drive's own watchdog would allow."""

    current_a: float
    flux_fraction: float
    axis_time_s: float
    lost_samples_s: float
    age_s: float
    dc_link_v: tuple[float, float]
    heatsink_degc: float
    winding_degc: float


def judge_block(block: SampleBlock, energised_s: float, flux_fraction: float, limits: WatchLimits) -> StopReason | None:
    """The first reason to stop that the newest block gives, most dangerous first."""
    current = _peak(block)
    if not math.isfinite(current) or current > limits.current_a:
        return StopReason(
            "the current passed its limit",
            current,
            limits.current_a,
            "check the motor's rated current and its connection; a shorted winding does this too",
            unit="A",
        )
    if not math.isfinite(flux_fraction) or flux_fraction > limits.flux_fraction:
        return StopReason(
            "the flux came too close to its rated value",
            flux_fraction,
            limits.flux_fraction,
            "lower limits.flux_fraction, and check rated voltage and frequency of the plate",
            unit="p.u.",
        )
    if block.clipped:
        return StopReason(
            "a current sensor reached the end of its range",
            current,
            "inside the range",
            "lower limits.current_fraction or fit a drive of higher rated current",
            is_fault=True,
            unit="A",
        )
    if energised_s > limits.axis_time_s:
        return StopReason(
            "the axis was energised too long",
            energised_s,
            limits.axis_time_s,
            "raise limits.axis_time_s",
            unit="s",
        )
    if not block.age_s <= limits.age_s:
        return StopReason(
            TOO_LATE,
            block.age_s,
            limits.age_s,
            "use a faster link or a host that is less busy",
            is_fault=True,
            unit="s",
        )
    lost_s = block.lost_before * block.sample_period_s
    if lost_s > limits.lost_samples_s:
        return StopReason(
            "the stream lost samples",
            lost_s,
            limits.lost_samples_s,
            "use a faster link, or a decimation the link can carry",
            is_fault=True,
            unit="s",
        )
    return _outside("the DC link left its range", block.dc_link_v, *limits.dc_link_v, "check the supply")


def judge_status(status: DriveStatus, limits: WatchLimits) -> StopReason | None:
    """The first reason to stop that the drive's status gives."""
    if status.fault_code:
        return StopReason(
            f"the drive tripped: {status.fault_text}",
            status.trip_value,
            status.trip_limit,
            AFTER_OVER_CURRENT
            if status.trip_unit == "A"
            else "remove the cause, reset the fault at the drive, start again",
            is_fault=True,
            unit=status.trip_unit,
        )
    if status.heatsink_degc > limits.heatsink_degc:
        return StopReason(
            "the heatsink is too hot", status.heatsink_degc, limits.heatsink_degc, "let the drive cool down", unit="°C"
        )
    if status.winding_degc > limits.winding_degc:
        return StopReason(
            "the winding is too hot", status.winding_degc, limits.winding_degc, "let the motor cool down", unit="°C"
        )
    return _outside("the DC link left its range", status.dc_link_v, *limits.dc_link_v, "check the supply")


def stop_if(reason: StopReason | None, step: str = "watch") -> None:
    """Raise what the reason amounts to; nothing where there is none."""
    if reason is None:
        return
    kind = DriveFault if reason.is_fault else Aborted
    raise kind(reason.what, step=step, value=reason.value, limit=reason.limit, remedy=reason.remedy, unit=reason.unit)


def _outside(what: str, value: float, low: float, high: float, remedy: str) -> StopReason | None:
    if low <= value <= high:
        return None
    return StopReason(what, value, f"{low:g} ... {high:g} V", remedy, is_fault=True, unit="V")


def _peak(block: SampleBlock) -> float:
    """Largest phase current magnitude; with two sensors the third phase follows from the sum."""
    w = block.current_w_a if block.current_w_a is not None else -(block.current_u_a + block.current_v_a)
    return peak(np.concatenate((block.current_u_a, block.current_v_a, w)))
