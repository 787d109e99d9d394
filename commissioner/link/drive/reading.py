"""Who a drive is and how it is, from its items. What its file does not describe is None, NaN or empty."""

from __future__ import annotations

import math
from collections.abc import Mapping

from commissioner.errors import IdentityMismatch, RequestRefused
from commissioner.link.drive.items import Items, number
from commissioner.motor.nameplate import RATED_VALUES
from commissioner.records import DriveIdentity, DriveStatus
from commissioner.registers.codec import Value
from commissioner.registers.misread import misread_word
from commissioner.registers.profile import IDENTITY_ITEMS, STATUS_ITEMS, DriveProfile
from commissioner.registers.status import DriveState, decode_bits, decode_state

BUS_CONTROL = "bus_control"
NAMEPLATE_ITEMS = (*RATED_VALUES, "pole_pairs", "pole_count")


def read_identity(items: Items) -> DriveIdentity:
    """Who answers. IdentityMismatch: not the drive, map or firmware of the drive file."""
    seen = items.read(IDENTITY_ITEMS)
    _check_identity(items.profile, seen)
    return DriveIdentity(
        drive_type=str(seen.get("drive_type", items.profile.name)),
        serial_number=_known(seen, "serial_number"),
        firmware_version=_version(_whole(seen, "firmware_version")) if "firmware_version" in seen else "",
        map_version=_known(seen, "map_version"),
        rated_drive_current_a=_real(seen, "rated_drive_current_a"),
        control_period_s=_real(seen, "control_period_s"),
        switching_frequency_hz=_real(seen, "switching_frequency_hz"),
    )


def read_status(items: Items) -> DriveStatus:
    """One reading of everything the drive says about its state."""
    profile, seen = items.profile, items.read((*STATUS_ITEMS, "settings_count"))
    state = _state(profile, seen)
    fault, trip = _known(seen, "fault_code"), _whole(seen, "trip_cause")
    return DriveStatus(
        state=state.value,
        is_energised=state.may_be_energised,
        fault_code=fault,
        fault_text="a fault of which the drive file knows no code" if fault is None else profile.fault_text(fault),
        trip_value=_real(seen, "trip_value"),
        trip_limit=_real(seen, "trip_limit"),
        interlocks=_interlocks(profile, seen),
        dc_link_v=_real(seen, "dc_link_v"),
        heatsink_degc=_real(seen, "heatsink_degc"),
        winding_degc=_real(seen, "winding_degc"),
        shaft_speed_rad_per_s=_real(seen, "shaft_speed_rad_per_s"),
        current_magnitude_a=_real(seen, "current_magnitude_a"),
        heartbeat_echo=_whole(seen, "heartbeat_echo"),
        session=_whole(seen, "session_id"),
        trip_cause=trip,
        trip_text=profile.fault_text(trip),
        trip_unit=profile.trip_units.get(trip, ""),
        present_scale=_real(seen, "present_scale"),
        present_bias_v=_real(seen, "present_bias_v"),
        test_time_left_s=_real(seen, "test_time_left_s"),
        samples_produced=_whole(seen, "samples_produced"),
        overruns=_whole(seen, "overruns"),
        settings_count=_whole(seen, "settings_count") if "settings_count" in seen else None,
    )


def read_others(items: Items) -> dict[str, Value | RequestRefused]:
    """What the drive file describes beside identity, status, plate and motor parameters, one item at a time; for an item that
    the drive refuses its refusal."""
    order = items.profile.parameter_names
    asked = {*IDENTITY_ITEMS, *STATUS_ITEMS, "settings_count", *NAMEPLATE_ITEMS, *order}
    out: dict[str, Value | RequestRefused] = {}
    for name in (n for n, item in items.profile.items.items() if "r" in item.access and n not in asked):
        try:
            out |= items.read([name])
        except RequestRefused as refused:
            out[name] = refused
    return out


def read_state(items: Items) -> DriveState:
    """The state alone, in one short request."""
    return _state(items.profile, items.read(["status_word"]))


def read_nameplate(items: Items) -> dict[str, float]:
    """The nameplate in the drive, by the contract's keys; what the drive file does not describe is left out."""
    seen = {name: number(value) for name, value in items.read(NAMEPLATE_ITEMS).items()}
    if "pole_count" in seen:
        seen["pole_pairs"] = seen.pop("pole_count") / 2
    return seen


def _state(profile: DriveProfile, seen: Mapping[str, Value]) -> DriveState:
    if profile.status_decoder == "none" or "status_word" not in seen:
        return DriveState.UNKNOWN
    return decode_state(profile.status_decoder, _whole(seen, "status_word"), profile.status_bits)


def _interlocks(profile: DriveProfile, seen: Mapping[str, Value]) -> dict[str, bool]:
    """The interlocks' own register, and the status word's bit by which some drives say that the bus is in control."""
    bits = decode_bits(_whole(seen, "interlocks"), profile.interlock_bits)
    if BUS_CONTROL in profile.status_bits and "status_word" in seen:
        bits["remote_control"] = bool(_whole(seen, "status_word") >> profile.status_bits[BUS_CONTROL] & 1)
    return bits


def _check_identity(profile: DriveProfile, seen: Mapping[str, Value]) -> None:
    wanted = profile.identity
    exact = {"magic": wanted.magic, "map_version": wanted.map_version, "drive_type": wanted.drive_type}
    for name, value in exact.items():
        if value is not None and seen.get(name) != value:
            raise _stranger(name, seen.get(name), value, profile)
    firmware, low, high = _whole(seen, "firmware_version"), wanted.firmware_min, wanted.firmware_max
    if (low is not None and firmware < low) or (high is not None and firmware > high):
        span = f"{_version(low or 0)} ... {_version(high) if high is not None else 'any'}"
        raise _stranger("firmware_version", _version(firmware), span, profile)


def _real(seen: Mapping[str, Value], name: str) -> float:
    return number(seen.get(name, math.nan))


def _known(seen: Mapping[str, Value], name: str) -> int | None:
    """None where the drive file has no such item: unknown is not 0."""
    return int(number(seen[name])) if name in seen else None


def _whole(seen: Mapping[str, Value], name: str) -> int:
    return int(number(seen.get(name, 0)))


def _version(word: int) -> str:
    """major.minor.patch, one byte each below the top byte."""
    return f"{word >> 16 & 0xFF}.{word >> 8 & 0xFF}.{word & 0xFF}"


def _stranger(name: str, seen: object, wanted: object, profile: DriveProfile) -> IdentityMismatch:
    """With what to try where the register holds the right value, read another way."""
    way = misread_word(seen, wanted)
    another = "check the URL, or name the drive file that fits this drive and firmware"
    return IdentityMismatch(
        f"this is not {profile.name}: {name} differs",
        step="identify",
        value=seen,
        limit=wanted,
        remedy=f"items.{name} (register {profile.items[name].address}): {way}" if way else another,
    )
