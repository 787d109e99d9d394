"""What a sheet says of its motor: circuits with errors, losses, each value beside what the circuit makes of it, and what stays open."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from commissioner.errors import DataRefused
from commissioner.identify.catalogue.contradictions import complete
from commissioner.identify.catalogue.evidence import LINEAR, Evidence, evidence_of, slip_of
from commissioner.identify.catalogue.fit import Fit, fit
from commissioner.identify.catalogue.machine import Array, at, breakdown, cages, inverse_gamma, loaded, performance
from commissioner.identify.catalogue.sheet import KEYS, Sheet, pole_pairs, synchronous_rpm
from commissioner.identify.contract import Silence
from commissioner.motor.nameplate import Nameplate
from commissioner.motor.quantities import FIELDS

SILENT = 0.75
"""Of an assumption's spread: an error above it is the assumption's, the sheet did not tell the value."""
_START = {"starting_current_ratio": "the starting current", "starting_torque_ratio": "the starting torque"}
WITHHELD: Mapping[str, tuple[str, Mapping[str, str]]] = {
    "stator_resistance_ohm": (
        "stator_resistance",
        {"winding_resistance_uv_ohm": "a winding resistance", "efficiency": "the efficiency", "rated_speed_rpm": "the rated speed"},
    ),
    "rotor_resistance_ohm": ("rotor_resistance", {"rated_speed_rpm": "the rated speed or slip"}),
    "leakage_inductance_h": ("leakage", {"breakdown_torque_ratio": "the breakdown torque", **_START}),
    "magnetizing_inductance_h": (
        "magnetizing_reactance", {"power_factor": "the power factor", "no_load_current_a": "the no-load current"},
    ),
}  # fmt: skip
"""Which assumption stands for which parameter, and what on a sheet tells it."""
WIDEST = 3.0
"""Of a logarithm's standard deviation, as stated; two cages beyond half of it are not told apart."""
UNMET = 0.05
"""Relative, by which a value that the circuit does not meet is named."""


@dataclass(frozen=True)
class Stated:
    """`std`: of a motor of this type; `of_type`: without the tolerances; the three parts, whose squares make that of `std`."""

    value: float
    std: float
    of_type: float
    rounding: float
    assumptions: float
    tolerances: float


@dataclass(frozen=True)
class Row:
    """A value of the sheet as printed and as the circuit has it; `is_fitted`: whether it was used."""

    key: str
    given: float
    reproduced: float
    is_fitted: bool


@dataclass(frozen=True)
class Answer:
    """`parameters`: the inverse-Gamma set at rated slip and T_R, without the `withheld`; `cages`: R_1, X_1, R_2, X_2 at rated frequency,
    none where start is not on the sheet; all per phase of the star equivalent."""

    sheet: Sheet
    parameters: Mapping[str, Stated]
    withheld: Mapping[str, str]
    t_circuit: Mapping[str, Stated]
    cages: Mapping[str, Stated]
    losses: Mapping[str, Stated]
    rows: tuple[Row, ...]
    assumed: tuple[Silence, ...]
    plate: Nameplate | None
    stator_flux_wb: float


def answer(sheet: Sheet) -> Answer:
    """Of a sheet without contradictions. DataRefused: it says too little for any parameter."""
    sheet = complete(sheet)
    evidence = evidence_of(sheet)
    if evidence is None:
        missing = [KEYS[k][0] for k in ("rated_voltage_v", "rated_frequency_hz", "rated_power_w") if not sheet.has(k)]
        raise _too_little(sheet, f"it lacks {', '.join(missing)}", ", ".join(missing))
    found = fit(evidence)
    every = _parameters(found)
    spreads = {a.name: a.std for a in evidence.assumptions}
    withheld = {
        k: _need(sheet, by)
        for k, (name, by) in WITHHELD.items()
        if every[k].of_type > math.expm1(SILENT * spreads[name]) * every[k].value
    }
    if len(withheld) == len(WITHHELD):
        raise _too_little(sheet, "it tells none of the four parameters", "; ".join(withheld.values()))
    parameters = _without(every, withheld)
    has_start = sheet.has("starting_current_ratio", "starting_torque_ratio")
    w = 2.0 * math.pi * evidence.scale.frequency_hz
    voltage = evidence.scale.voltage_v
    return Answer(
        sheet, parameters, withheld,
        {} if withheld else _named(found, _t_circuit(evidence), ("R_1", "R_2", "X_1", "X_2", "X_M")),
        _cages(found) if has_start and not withheld else {},
        _losses(found), tuple(_rows(sheet, found)), _assumed(found), _plate(sheet, found), math.sqrt(2.0) * 0.95 * voltage / w,
    )  # fmt: skip


def _need(sheet: Sheet, told_by: Mapping[str, str]) -> str:
    """What of this the sheet lacks."""
    return ", ".join(words for key, words in told_by.items() if not sheet.has(key)) or "more digits"


def _too_little(sheet: Sheet, why: str, need: str) -> DataRefused:
    return DataRefused(
        f"{sheet.source}: the sheet says too little: {why}", step="read the sheet", value=", ".join(sheet.values) or "nothing",
        limit=f"what is missing: {need}", remedy="add rated power, voltage, frequency, speed, current, power factor and efficiency, and "
        "M_K/M_N, I_A/I_N, M_A/M_N",
    )  # fmt: skip


def _named(found: Fit, of: Callable[[Array], Array], names: tuple[str, ...]) -> dict[str, Stated]:
    """Values and errors of positive quantities `of` (n, 11) -> (n, m): the fit is in logarithms, a standard deviation is the way up."""
    value = of(found.numbers[None])[0]
    spread = found.spread(lambda x: np.log(of(x)))
    parts = (spread.of_motor, spread.of_type, spread.rounding, spread.assumptions, spread.tolerances)
    motor, of_type, *three = (np.sqrt(np.clip(np.diag(p), 1e-18, WIDEST**2)) for p in parts)
    std = [
        value * np.expm1(motor),
        value * np.expm1(of_type),
        *(value * part * np.expm1(motor) / motor for part in three),
    ]
    return {n: Stated(float(value[k]), *(float(s[k]) for s in std)) for k, n in enumerate(names)}


def _rated_slip(evidence: Evidence, numbers: Array) -> Array:
    return np.asarray(loaded(numbers, np.array([evidence.scale.shaft])).slip[:, 0])


def _parameters(found: Fit) -> dict[str, Stated]:
    scale = found.evidence.scale
    w = 2.0 * math.pi * scale.frequency_hz
    units = scale.impedance_ohm * np.array([1.0, 1.0, 1.0 / w, 1.0 / w])

    def of(x: Array) -> Array:
        four = inverse_gamma(x, _rated_slip(found.evidence, x)) * units
        return np.concatenate([four, four[:, 3:] / four[:, 1:2]], axis=1)

    return _named(found, of, FIELDS)


def _without(every: Mapping[str, Stated], withheld: Mapping[str, str]) -> dict[str, Stated]:
    """Without the withheld and the time constant that needs them."""
    is_timeless = {"rotor_resistance_ohm", "magnetizing_inductance_h"} & set(withheld)
    lost = {*withheld, *(("rotor_time_constant_s",) if is_timeless else ())}
    return {k: v for k, v in every.items() if k not in lost}


def _t_circuit(evidence: Evidence) -> Callable[[Array], Array]:
    """R_1, R_2, X_1, X_2, X_M at rated slip, ohm at rated frequency."""

    def of(x: Array) -> Array:
        slip = _rated_slip(evidence, x)
        r_0, x_r, d, t = (x[:, k] for k in (2, 3, 5, 6))
        p = 1j * slip * t
        slow = r_0 * d * p / (1.0 + p)
        return (
            np.stack([x[:, 0], r_0 + slow.real, x[:, 4], x_r + slow.imag / slip, x[:, 1]], axis=1)
            * evidence.scale.impedance_ohm
        )

    return of


def _cages(found: Fit) -> dict[str, Stated]:
    """R_1, X_1, R_2, X_2; nothing where the sheet does not tell two cages apart."""
    ohm = found.evidence.scale.impedance_ohm
    two = _named(found, lambda x: cages(x) * ohm, ("R_1", "X_1", "R_2", "X_2"))
    return two if all(q.of_type < math.expm1(0.5 * WIDEST) * q.value for q in two.values()) else {}


def _losses(found: Fit) -> dict[str, Stated]:
    scale = found.evidence.scale

    def of(x: Array) -> Array:
        point = at(x, _rated_slip(found.evidence, x))
        stator, rotor = x[:, 0] * point.current**2, point.gap * point.slip
        stray = x[:, 9] * point.current**2
        return scale.power_w * np.stack([stator, rotor, point.power - point.gap - stator, x[:, 8], stray], axis=1)

    return _named(found, of, ("stator_copper_w", "rotor_copper_w", "iron_w", "friction_w", "stray_w"))


def _rows(sheet: Sheet, found: Fit) -> list[Row]:
    """What is fitted, then what only follows."""
    evidence = found.evidence
    predicted = dict(zip((d.key for d in evidence.data), evidence.predicted(found.numbers[None])[0], strict=True))
    value = {k: float(v if k in LINEAR else math.exp(v)) for k, v in predicted.items()}
    is_speed = slip_of(sheet) is not sheet.values.get("rated_slip")
    current = {"rated_current": "rated_current_a", "no_load_current": "no_load_current_a"}
    out = []
    for datum in evidence.data:
        key = current.get(datum.key, datum.key)
        if key in sheet.values and key != "r_s" and not (key == "rated_slip" and is_speed):
            out.append(
                Row(
                    key,
                    sheet.values[key].value,
                    value[datum.key] * (evidence.scale.current_a if key in current.values() else 1.0),
                    True,
                )
            )
    made = performance(found.numbers[None], evidence.scale.shaft)
    slip, synchronous = float(made["rated_slip"][0]), synchronous_rpm(sheet)
    if sheet.has("rated_speed_rpm") and synchronous is not None:
        out.insert(
            0, Row("rated_speed_rpm", sheet.values["rated_speed_rpm"].value, synchronous * (1.0 - slip), is_speed)
        )
        if sheet.has("rated_torque_nm"):
            torque = evidence.scale.shaft * evidence.scale.power_w / (synchronous * (1.0 - slip) * math.pi / 30.0)
            out.append(Row("rated_torque_nm", sheet.values["rated_torque_nm"].value, torque, False))
    if sheet.has("pull_up_torque_ratio"):
        out.append(
            Row("pull_up_torque_ratio", sheet.values["pull_up_torque_ratio"].value, _pull_up(found, slip), False)
        )
    return out


def _pull_up(found: Fit, rated_slip: float) -> float:
    """The least torque between standstill and breakdown over the rated one; leakages between the two by the logarithm of the slip."""
    x = found.numbers[None]
    peak = float(breakdown(x)[0][0])
    slips = np.geomspace(min(peak, 0.99), 1.0, 60)
    leakage = x[0, 10] ** (0.5 + 0.5 * np.log(slips / slips[0]) / np.log(1.0 / slips[0]))
    gap = at(np.repeat(x, slips.size, axis=0), slips, leakage).gap
    return float(gap.min() * (1.0 - rated_slip) / found.evidence.scale.shaft)


def _assumed(found: Fit) -> tuple[Silence, ...]:
    logs = found.evidence.assumed(found.numbers[None])[0]
    return tuple(
        Silence(a.name, a.words, math.exp(value), math.exp(a.std * left), left, a.source)
        for a, value, left in zip(found.evidence.assumptions, logs.tolist(), found.told.tolist(), strict=True)
        if left > SILENT
    )


def _plate(sheet: Sheet, found: Fit) -> Nameplate | None:
    """The plate as other verbs take it; None where the sheet lacks one of its values."""
    scale, speed, pairs = found.evidence.scale, sheet.get("rated_speed_rpm"), pole_pairs(sheet)
    if (
        speed is None
        and (slip := sheet.get("rated_slip")) is not None
        and (synchronous := synchronous_rpm(sheet)) is not None
    ):
        speed = synchronous * (1.0 - slip)
    factor, efficiency = sheet.get("power_factor"), sheet.get("efficiency")
    if factor is None and efficiency is not None:
        factor = scale.shaft / efficiency
    if speed is None or pairs is None or factor is None:
        return None
    return Nameplate(
        scale.shaft * scale.power_w, scale.voltage_v * math.sqrt(3.0), scale.frequency_hz, scale.current_a, speed, factor, pairs,
        sheet.connection or "star", sheet.get("inertia_kg_m2"),
    )  # fmt: skip
