"""Values of one sheet that cannot be true together: both by name, and which of them is dropped where somebody says what is right."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from commissioner.errors import DataRefused
from commissioner.identify.catalogue.evidence import slip_of
from commissioner.identify.catalogue.sheet import ABSOLUTE, KEYS, Sheet, pole_pairs, synchronous_rpm
from commissioner.motor.nameplate import (
    LARGEST_SLIP,
    LARGEST_SLIP_OF_MORE_W,
    Nameplate,
    efficiency_range,
    typical_efficiency,
)

APART = 0.03
"""Relative, beyond the last digits: catalogues round power, current and efficiency each for itself."""
HORSE_POWER = 745.7
FACTORS = (
    (math.sqrt(3.0), "star and delta, or line and phase values, mixed up"), (HORSE_POWER / 1000.0, "horse power for kW"),
    (9.80665, "kg m for N m"), (1.35582, "lb ft for N m"), (1.2, "values of 50 and 60 Hz mixed"), (2.0, "poles and pole pairs mixed up"),
    (100.0, "per cent for per unit"), (1000.0, "a factor of thousand"),
)  # fmt: skip


@dataclass(frozen=True)
class Conflict:
    """`parties`: words for `--trust`, and which keys are dropped where that word is right."""

    what: str
    value: str
    limit: str
    parties: Mapping[str, tuple[str, ...]]

    def refusal(self, source: str) -> DataRefused:
        words = " or ".join(f"--trust {word}" for word in self.parties)
        remedy = f"correct the sheet, or say which is right: {words}" if self.parties else "correct the sheet"
        return DataRefused(
            f"{source}: {self.what}", step="read the sheet", value=self.value, limit=self.limit, remedy=remedy
        )


def settled(sheet: Sheet, trusted: frozenset[str]) -> Sheet:
    """The sheet without contradictions: what was told to be right stands. DataRefused: one that nobody decided."""
    for _ in range(len(KEYS)):
        conflict = next(_conflicts(sheet), None)
        if conflict is None:
            return sheet
        word = next((w for w in conflict.parties if w in trusted), None)
        if word is None:
            raise conflict.refusal(sheet.source)
        said = f"{conflict.what} ({conflict.value}): {word} was trusted, as told"
        sheet = replace(sheet.without(*conflict.parties[word]), remarks=(*sheet.remarks, said))
    return sheet


def with_plate(sheet: Sheet, plate: Nameplate, trusted: frozenset[str]) -> Sheet:
    """With the values of a plate that the sheet lacks. DataRefused where both say different things and nobody decided (plate, data)."""
    for key in (
        "rated_power_w",
        "rated_voltage_v",
        "rated_frequency_hz",
        "rated_speed_rpm",
        "rated_current_a",
        "power_factor",
        "pole_pairs",
    ):
        said, value = sheet.get(key), float(getattr(plate, key))
        differ = said is not None and abs(value / said - 1.0) > (0.005 if key == "rated_speed_rpm" else 0.03)
        if differ and not trusted & {"plate", "data"}:
            raise Conflict(
                f"the {KEYS[key][0]} of sheet and plate contradict each other", f"{said:g} on the sheet, {value:g} on the plate",
                "the same within 3 %", {"plate": (), "data": ()},
            ).refusal(sheet.source)  # fmt: skip
        if said is None or (differ and "plate" in trusted):
            sheet = sheet.with_value(key, value)
    return sheet if sheet.connection else replace(sheet, connection=plate.connection)


def complete(sheet: Sheet) -> Sheet:
    """Ratios from absolute values; the power from torque and speed where it is not printed."""
    torque, speed = sheet.get("rated_torque_nm"), _speed(sheet)
    if not sheet.has("rated_power_w") and torque is not None and speed is not None:
        printed = sheet.values["rated_torque_nm"]
        sheet = sheet.with_value("rated_power_w", torque * speed, printed.half_step * speed)
    if torque is None and sheet.has("rated_power_w") and speed is not None:
        torque = sheet.values["rated_power_w"].value / speed
    for stem, base in ABSOLUTE.items():
        absolute = sheet.values.get(stem + ("_a" if base == "rated_current_a" else "_nm"))
        over = sheet.get(base) if base == "rated_current_a" else torque
        if absolute is not None and over and not sheet.has(stem + "_ratio"):
            sheet = sheet.with_value(stem + "_ratio", absolute.value / over, absolute.half_step / over)
    return sheet


def _speed(sheet: Sheet) -> float | None:
    """Rated, in rad/s."""
    rpm, slip, synchronous = sheet.get("rated_speed_rpm"), sheet.get("rated_slip"), synchronous_rpm(sheet)
    if rpm is None and slip is not None and synchronous is not None:
        rpm = synchronous * (1.0 - slip)
    return None if rpm is None else rpm * math.pi / 30.0


def _conflicts(sheet: Sheet) -> Iterator[Conflict]:
    yield from _of_speed(sheet)
    yield from _of_power(sheet)
    yield from _of_torque(sheet)
    yield from _of_ratios(sheet)


def _of_speed(sheet: Sheet) -> Iterator[Conflict]:
    speed, synchronous, frequency = (
        sheet.get("rated_speed_rpm"),
        synchronous_rpm(sheet),
        sheet.get("rated_frequency_hz"),
    )
    if speed is None or synchronous is None or frequency is None:
        return
    slip = 1.0 - speed / synchronous
    is_small = (sheet.get("rated_power_w") or 1e4) <= LARGEST_SLIP_OF_MORE_W[0]
    most = LARGEST_SLIP if is_small else LARGEST_SLIP_OF_MORE_W[1]
    if not 0.0 < slip < most:
        other = next((f for f in (50.0, 60.0) if f != frequency and 0.0 < _slip_at(f, speed) < 0.1), None)
        hint = "" if other is None else f" (it fits {other:g} Hz: 50 and 60 Hz mixed?)"
        yield Conflict(
            f"the rated speed does not belong to the frequency and pole pairs{hint}",
            f"{speed:g} 1/min, {synchronous:g} 1/min synchronous at {frequency:g} Hz with {pole_pairs(sheet)} pole pairs",
            f"a slip of 0 ... {most:g}, here {slip:.3g}", {},
        )  # fmt: skip
    printed = sheet.values.get("rated_slip")
    if (
        printed is not None
        and abs(printed.value - slip)
        > 0.003 + printed.half_step + sheet.values["rated_speed_rpm"].half_step / synchronous
    ):
        yield Conflict(
            "rated slip and rated speed contradict each other", f"slip {printed.value:.4g} printed, {slip:.4g} from {speed:g} 1/min",
            "the same slip", {"slip": ("rated_speed_rpm",), "speed": ("rated_slip",)},
        )  # fmt: skip


def _slip_at(frequency_hz: float, speed_rpm: float) -> float:
    return 1.0 - speed_rpm * int(60.0 * frequency_hz / speed_rpm) / (60.0 * frequency_hz)


def _of_power(sheet: Sheet) -> Iterator[Conflict]:
    power, voltage, current, factor, efficiency = (
        sheet.get(k) for k in ("rated_power_w", "rated_voltage_v", "rated_current_a", "power_factor", "efficiency")
    )
    slip = slip_of(sheet)
    if efficiency is not None and slip is not None and efficiency > 1.0 - slip.value + 0.01:
        yield Conflict(
            "efficiency and speed contradict each other: the rotor alone loses the slip's part of the power",
            f"efficiency {efficiency:.4g}, slip {slip.value:.3g}", f"an efficiency below {1.0 - slip.value:.4g}",
            {"efficiency": ("rated_speed_rpm", "rated_slip"), "speed": ("efficiency",)},
        )  # fmt: skip
    if power is None or voltage is None or current is None or factor is None:
        return
    implied = power / (math.sqrt(3.0) * voltage * current * factor)
    text = f"P / (sqrt(3) U I cos phi) = {implied:.4g}"
    if efficiency is not None and _apart(
        implied / efficiency, sheet, "rated_current_a", "power_factor", "efficiency", "rated_power_w"
    ):
        yield Conflict(
            f"power, voltage, current and power factor contradict the efficiency{_hint(implied / efficiency)}",
            f"efficiency {efficiency:.4g} printed, {text}", f"the same within {APART:.0%} and the last digits",
            {"efficiency": ("rated_current_a",), "current": ("efficiency",)},
        )  # fmt: skip
    pairs = pole_pairs(sheet) or 2
    typical, (least, best) = typical_efficiency(power, pairs), efficiency_range(power, pairs)
    if efficiency is None and not least < implied < best:
        yield Conflict(
            f"power, voltage, current and power factor contradict each other{_hint(implied / typical)}", text,
            f"{least:.2g} ... {best:.3g}, motors of this size have {typical:.2g}", {"power": ("rated_current_a",)},
        )  # fmt: skip


def _of_torque(sheet: Sheet) -> Iterator[Conflict]:
    torque, power, speed = sheet.get("rated_torque_nm"), sheet.get("rated_power_w"), _speed(sheet)
    if torque is None or power is None or speed is None:
        return
    if _apart(torque * speed / power, sheet, "rated_torque_nm", "rated_power_w"):
        yield Conflict(
            f"the rated torque contradicts power and speed{_hint(torque * speed / power)}",
            f"{torque:.4g} N m printed, P / omega = {power / speed:.4g} N m", f"the same within {APART:.0%} and the last digits",
            {"torque": ("rated_power_w",), "power": ("rated_torque_nm",)},
        )  # fmt: skip


def _of_ratios(sheet: Sheet) -> Iterator[Conflict]:
    whole = complete(sheet)
    for stem, base in ABSOLUTE.items():
        key = stem + ("_a" if base == "rated_current_a" else "_nm")
        absolute, ratio = sheet.get(key), sheet.get(stem + "_ratio")
        follows = complete(sheet.without(stem + "_ratio")).get(stem + "_ratio")
        if (
            absolute is not None
            and ratio is not None
            and follows is not None
            and _apart(follows / ratio, sheet, key, stem + "_ratio", base)
        ):
            yield Conflict(
                f"{KEYS[key][0]} and its ratio contradict each other", f"{ratio:.4g} printed, {follows:.4g} from {absolute:.4g} {KEYS[key][1]}",
                f"the same within {APART:.0%} and the last digits", {"ratio": (key,), "absolute": (stem + "_ratio",)},
            )  # fmt: skip
    current, start, peak = (
        whole.get(k) for k in ("starting_current_ratio", "starting_torque_ratio", "breakdown_torque_ratio")
    )
    if current is not None and current <= 1.0:
        yield Conflict("the starting current is below the rated one", f"I_A/I_N = {current:.4g}", "above 1, of cage motors 3 ... 10",
                       {"rated": ("starting_current_ratio", "starting_current_a")})  # fmt: skip
    if peak is not None and peak <= 1.0:
        yield Conflict("the breakdown torque is below the rated one", f"M_K/M_N = {peak:.4g}", "above 1, by IEC 60034-1 at least 1.6",
                       {"rated": ("breakdown_torque_ratio", "breakdown_torque_nm")})  # fmt: skip
    if peak is not None and start is not None and start > 1.04 * peak:
        yield Conflict(
            "the starting torque is above the breakdown torque", f"M_A/M_N = {start:.4g}, M_K/M_N = {peak:.4g}", "the largest torque is M_K",
            {"starting": ("breakdown_torque_ratio", "breakdown_torque_nm"), "breakdown": ("starting_torque_ratio", "starting_torque_nm")},
        )  # fmt: skip


def _apart(ratio: float, sheet: Sheet, *keys: str) -> bool:
    digits = sum(v.half_step / abs(v.value) for k in keys if (v := sheet.values.get(k)) is not None)
    return abs(math.log(ratio)) > APART + digits


def _hint(ratio: float) -> str:
    """The usual factor within 4 % of a ratio or its inverse."""
    near = next((words for factor, words in FACTORS if abs(abs(math.log(ratio)) - abs(math.log(factor))) < 0.04), "")
    return f" ({near}?)" if near else ""
