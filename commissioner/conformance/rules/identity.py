"""Rules of identity, ratings and measurements: what anybody may read at any time."""

from __future__ import annotations

import math

from commissioner.conformance.drive import Drive, is_close
from commissioner.conformance.records import Broken, NotTested, Steps
from commissioner.conformance.registry import rules_of
from commissioner.motor.nameplate import RATED_VALUES

RULES, rule = rules_of("The commissioning map: identity, status")

CONTROL_PERIOD_S = (2e-5, 1e-3)
"""1 to 50 kHz: what drives have."""
SHORTEST_RING_S = 0.25
"""A reader is up to 50 ms late, and once in a while more: `Truths about the link`, 4."""


@rule
def magic_and_map_version(drive: Drive) -> Steps[None]:
    """Magic number and map version are the drive file's."""
    seen = yield from drive.get_word_by_word("magic", "map_version")  # a fault in longer reads has rules of its own
    wanted = drive.profile.identity
    for name, value in (("magic", wanted.magic), ("map_version", wanted.map_version)):
        if value is not None and seen[name] != value:
            raise Broken(f"{name} is {seen[name]!r}, wanted {value!r}")


@rule
def type_and_firmware(drive: Drive) -> Steps[None]:
    """Drive type and firmware version are the drive file's."""
    seen = yield from drive.get("drive_type", "firmware_version")
    wanted = drive.profile.identity
    if wanted.drive_type is not None and seen["drive_type"] != wanted.drive_type:
        raise Broken(f"drive_type is {seen['drive_type']!r}, wanted {wanted.drive_type!r}")
    version = seen["firmware_version"]
    assert isinstance(version, int)
    if not (wanted.firmware_min or 0) <= version <= (wanted.firmware_max or 0xFFFFFFFF):
        raise Broken(f"firmware_version is 0x{version:08X}, outside the drive file's range")


@rule
def serial_number_stays(drive: Drive) -> Steps[None]:
    """The serial number is not zero and the same each time."""
    first = yield from drive.number("serial_number")
    second = yield from drive.number("serial_number")
    if not first or first != second:
        raise Broken(f"the serial number reads {first:g}, then {second:g}")


@rule
def ratings_can_be(drive: Drive) -> Steps[None]:
    """Rated current, control period and switching frequency are numbers that a drive can have."""
    current_a = yield from drive.number("rated_drive_current_a")
    period_s = yield from drive.number("control_period_s")
    switching_hz = yield from drive.number("switching_frequency_hz")
    if not (math.isfinite(current_a) and current_a > 0):
        raise Broken(f"rated_drive_current_a is {current_a}")
    if not CONTROL_PERIOD_S[0] <= period_s <= CONTROL_PERIOD_S[1]:
        raise Broken(
            f"control_period_s is {period_s:g} s, wanted {CONTROL_PERIOD_S[0]:g} ... {CONTROL_PERIOD_S[1]:g} s"
        )
    turns = switching_hz * period_s
    if not (is_close(turns, 0.5, 1e-3) or is_close(turns, max(1.0, round(turns)), 1e-3)):
        raise Broken(f"control period times switching frequency is {turns:g}, wanted a half or a whole number")


@rule
def stream_scales_reach(drive: Drive) -> Steps[None]:
    """The window's 16-bit counts reach the current sensor's end and the DC link, and the ring bridges a late reader."""
    scale_a, full_a = (yield from drive.number("current_scale_a")), (yield from drive.number("current_full_scale_a"))
    scale_v, link_v = (yield from drive.number("dc_link_scale_v")), (yield from drive.number("dc_link_v"))
    if not scale_a > 0 or not full_a > 0 or scale_a * 32768 < full_a:
        raise Broken(f"32767 counts of {scale_a:g} A do not reach the full scale of {full_a:g} A")
    if not scale_v > 0 or scale_v * 32767 < link_v:
        raise Broken(f"32767 counts of {scale_v:g} V do not reach the DC link of {link_v:g} V")
    held_s = (yield from drive.number("ring_capacity")) * (yield from drive.number("control_period_s"))
    if held_s < SHORTEST_RING_S:
        raise Broken(f"the ring holds {held_s:.3g} s of samples, wanted at least {SHORTEST_RING_S:g} s")


@rule
def measurements_can_be(drive: Drive) -> Steps[None]:
    """DC link, temperatures and shaft speed are numbers within the drive file's limits at rest; NaN only for a winding without sensor."""
    names = ("dc_link_v", "heatsink_degc", "winding_degc", "shaft_speed_rad_per_s")
    link_v, heatsink, winding, speed = yield from drive.numbers(*names)
    limits = drive.profile.limits
    if not (limits.dc_link_min_v or 0) <= link_v <= (limits.dc_link_max_v or math.inf):
        raise Broken(f"dc_link_v is {link_v:g} V, wanted {limits.dc_link_min_v} ... {limits.dc_link_max_v} V")
    if not -40 <= heatsink <= (limits.heatsink_max_degc or 150):
        raise Broken(f"heatsink_degc is {heatsink:g}")
    if not (math.isnan(winding) or -40 <= winding <= (limits.winding_max_degc or 200)):
        raise Broken(f"winding_degc is {winding:g}")
    if not abs(speed) < 0.5:
        raise Broken(f"shaft_speed_rad_per_s is {speed:g} at rest")


@rule
def interlocks_are_the_files(drive: Drive) -> Steps[None]:
    """Only interlocks of the drive file are set, and the status word's remote bit says what the interlock says."""
    (word,) = yield from drive.words("interlocks")
    (status,) = yield from drive.words("status_word")
    bits = drive.profile.interlock_bits
    known = sum(1 << bit for bit in bits.values())
    if word & ~known:
        raise Broken(f"interlocks is 0x{word:04X}; the drive file knows the bits 0x{known:04X}")
    is_remote = bool(word >> bits["remote_control"] & 1) if "remote_control" in bits else bool(status & 0x0200)
    if drive.profile.status_decoder == "cia402" and is_remote != bool(status & 0x0200):
        raise Broken(
            f"remote control is {is_remote} in the interlocks and {not is_remote} in status word 0x{status:04X}"
        )


@rule
def plate_of_the_motor(drive: Drive) -> Steps[None]:
    """The nameplate in the drive belongs together: apparent power covers the shaft's, the speed lies below synchronism."""
    names = (*RATED_VALUES, "pole_pairs")
    if not all(name in drive.profile.items for name in names):
        raise NotTested("the drive file describes no whole nameplate")
    plate = dict(zip(names, (yield from drive.numbers(*names)), strict=True))
    if not any(plate.values()):
        raise NotTested("the drive holds no nameplate")
    apparent_va = math.sqrt(3) * plate["rated_voltage_v"] * plate["rated_current_a"]
    if not 0 < plate["rated_power_w"] < apparent_va * plate["power_factor"]:
        raise Broken(f"{plate['rated_power_w']:g} W at the shaft of {apparent_va * plate['power_factor']:.0f} W taken")
    synchronous = 60.0 * plate["rated_frequency_hz"] / max(plate["pole_pairs"], 1)
    if not 0.7 * synchronous < plate["rated_speed_rpm"] < synchronous:
        raise Broken(f"{plate['rated_speed_rpm']:g} 1/min with a synchronous speed of {synchronous:g} 1/min")
