"""The ohms of a table of test points per star phase: between two terminals, of one winding, or of the star equivalent.

Between two terminals are two star phases, whatever the connection; a winding in star is one star phase, a winding in delta
three. Where neither the column's name nor `resistance_measured` says which, the readings that leave no possible rotor are
ruled out; where more than one is left, nothing is assumed.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.intake.refusal import refused
from commissioner.errors import DataRefused
from commissioner.motor.nameplate import connection_of
from commissioner.records import POINT_RESISTANCES, TERMINAL_PAIRS, WINDINGS

Array = NDArray[np.float64]
KINDS: Mapping[str, str] = {
    "line_to_line": "between two terminals",
    "phase_winding": "of one winding",
    "star_equivalent": "of one phase of the star equivalent",
}
SYNONYMS = {
    "terminal": "line_to_line", "terminals": "line_to_line", "line": "line_to_line", "between_terminals": "line_to_line",
    "winding": "phase_winding", "phase": "phase_winding", "star": "star_equivalent",
}  # fmt: skip
SAID_BY_NAME: Mapping[str, str] = {
    **dict.fromkeys(TERMINAL_PAIRS, "line_to_line"),
    **dict.fromkeys(WINDINGS, "phase_winding"),
    "winding_resistance_line_ohm": "line_to_line",
    "terminal_resistance_ohm": "line_to_line",
    "winding_resistance_phase_ohm": "phase_winding",
}
"""Columns whose names say what they hold."""
ROTOR_OVER_STATOR = (0.25, 8.0)
"""Inverse-Gamma R_R over R_s: 0.46 ... 2.5 in 35 published machines (tests/data/motors), widened downwards by half for a hot
stator, upwards three times for bars in which the current is displaced at standstill."""
ROTOR_OVER_SLIP = (0.35, 6.6)
"""R_R over rated slip and base impedance: the plate's box (`motor.nameplate`), three times its end for displacement."""

COPPER_PER_K, WARMING_K = 1.0 / (234.5 + 25.0), 10.0
"""Relative rise of copper's resistance per kelvin at 25 degC (IEC 60034-1), and a warming as locked points make it."""

APART = {TERMINAL_PAIRS: 0.1, WINDINGS: 0.02}
"""By which the resistances between three pairs of terminals, or of three windings, may differ: sound ones by one or two per cent."""
LIKE_RESISTANCE = re.compile(r"ohm|\u03a9|\u2126|r[eé]sist|widerstand|^r(?:[ _-]|$)", re.IGNORECASE)


@dataclass(frozen=True)
class Resistance:
    """Per star phase at every point, `(n,)`, None where nothing is given; and what was decided."""

    star_ohm: Array | None
    remarks: tuple[str, ...] = ()


def column_of(
    columns: Mapping[str, Array], metadata: Mapping[str, float | str]
) -> tuple[str, Array] | DataRefused | None:
    """Name and values `(n,)` of the resistance that a table gives, as a column or once for all rows; of several pairs of
    terminals, or of the three windings, their mean. DataRefused: they are not of one motor that is sound."""
    rows = next(iter(columns.values())).size
    given = {n: ohm for n in POINT_RESISTANCES if (ohm := _given(n, columns, metadata, rows)) is not None}
    for names, apart in APART.items():
        alike = {name: given[name] for name in names if name in given and np.isfinite(given[name]).any()}
        if alike:
            return _mean(alike, apart)
    return next(iter(given.items()), None)


def _given(name: str, columns: Mapping[str, Array], metadata: Mapping[str, float | str], rows: int) -> Array | None:
    if name in columns:
        return np.asarray(columns[name], dtype=float)
    said = metadata.get(name)
    return np.full(rows, float(said)) if isinstance(said, float | int) else None


def _mean(alike: Mapping[str, Array], apart: float) -> tuple[str, Array] | DataRefused:
    means = {name: float(np.nanmean(ohm)) for name, ohm in alike.items()}
    if max(means.values()) > (1.0 + apart) * min(means.values()):
        return refused(
            "the resistances between the terminals differ" if set(alike) <= set(TERMINAL_PAIRS) else "the windings' resistances differ",
            ", ".join(f"{name} {ohm:.4g}" for name, ohm in means.items()), f"{apart:.0%} between the largest and the least",
            "check their units and the contacts; a winding of other resistance than its neighbours is a fault of the motor",
        )  # fmt: skip
    return next(iter(alike)), np.asarray(np.mean(list(alike.values()), axis=0))


def unread(columns: Iterable[str], metadata: Mapping[str, float | str]) -> list[str]:
    """Columns, and lines above them, that look like the windings' resistance and are called by no name that is known."""
    lines = [name for name, said in metadata.items() if str(said).strip()[:1].isdigit()]
    return [name for name in (*columns, *lines) if name not in POINT_RESISTANCES and LIKE_RESISTANCE.search(name)]


def star_resistance(
    name: str, ohm: Array, measured_ohm: Array, metadata: Mapping[str, float | str], *, is_locked: bool
) -> Resistance | DataRefused:
    """`ohm` per star phase. `measured_ohm`: P / (3 I^2) of the points, which it is a part of.

    DataRefused: the kind is not told and several are possible, or the told one is not possible.
    """
    told = _told(name, metadata)
    if isinstance(told, DataRefused):
        return told
    readings = _readings(told, str(connection_of(metadata.get("connection", ""))))
    if told == "phase_winding" and len(readings) > 1:
        return refused(
            f"{name} is of one winding, and whether the windings are in star or in delta is not told",
            "; ".join(_left(kind, f, ohm, measured_ohm, is_locked=is_locked) for kind, f in readings),
            "connection: star, or delta", "add `# connection: star` (or delta) to the table, or give --motor",
        )  # fmt: skip
    possible = [r for r in readings if _is_possible(r[1] * ohm, measured_ohm, metadata, is_locked=is_locked)]
    if not possible:
        return _impossible(name, ohm, measured_ohm, readings, is_locked=is_locked)
    if len({factor for _, factor in possible}) > 1:
        return _ask(name, ohm, measured_ohm, possible, is_locked=is_locked)
    kind, factor = possible[0]
    if told is not None:
        return Resistance(factor * ohm)
    return Resistance(
        factor * ohm,
        (
            f"{name} was taken as {kind} ({factor:.3g} of it per star phase): with any other reading no motor answers so. Say "
            "which it is by resistance_measured.",
        ),
    )


def _told(name: str, metadata: Mapping[str, float | str]) -> str | DataRefused | None:
    said = metadata.get("resistance_measured")
    if said is None:
        return SAID_BY_NAME.get(name)
    key = str(said).strip().lower().replace(" ", "_").replace("-", "_")
    key = SYNONYMS.get(key, key)
    if key not in KINDS:
        return refused(
            f"resistance_measured is {str(said)[:60]!r}", str(said)[:60], ", ".join(KINDS), "correct it in the table"
        )
    if SAID_BY_NAME.get(name, key) != key:
        return refused(
            f"{name} says {KINDS[SAID_BY_NAME[name]]}, resistance_measured says {KINDS[key]}", key, "one of the two",
            "rename the column resistance_ohm, or correct resistance_measured",
        )  # fmt: skip
    return key


def _readings(told: str | None, connection: str) -> list[tuple[str, float]]:
    """What the number may be, in words, and the factor to a star phase."""
    winding = [("of one winding in star", 1.0), ("of one winding in delta", 1.0 / 3.0)]
    if connection in ("star", "delta"):
        winding = [w for w in winding if w[0].endswith(connection)]
    if told == "line_to_line":
        return [("between two terminals", 0.5)]
    if told == "star_equivalent":
        return [("of a star phase", 1.0)]
    if told == "phase_winding":
        return winding
    return [("between two terminals", 0.5), *winding, ("of a star phase", 1.0)]


def rotor_ohm(star_ohm: Array, measured_ohm: Array) -> float:
    """What is left for the rotor."""
    return float(np.median(measured_ohm - star_ohm))


def of_one_measurement(star_ohm: Array, measured_ohm: Array) -> tuple[str, ...]:
    """What one resistance for all points of a locked rotor leaves open; nothing where it was measured beside them."""
    if star_ohm.size < 2 or np.ptp(star_ohm) > 0.0:
        return ()
    share = WARMING_K * COPPER_PER_K * float(star_ohm[0]) / rotor_ohm(star_ohm, measured_ohm)
    return (
        f"One winding resistance was given for all points: each {WARMING_K:g} K that the winding was warmer in the test than when it was "
        f"measured are {share:.1%} in R_R, which its error does not hold.",
    )


def _is_possible(star_ohm: Array, measured_ohm: Array, metadata: Mapping[str, float | str], *, is_locked: bool) -> bool:
    if np.any(star_ohm <= 0.0) or np.any(star_ohm >= measured_ohm):
        return False
    if not is_locked:
        return True
    rotor = rotor_ohm(star_ohm, measured_ohm)
    if not ROTOR_OVER_STATOR[0] < rotor / float(np.median(star_ohm)) < ROTOR_OVER_STATOR[1]:
        return False
    per_slip = _ohm_at_slip(metadata)
    return per_slip is None or ROTOR_OVER_SLIP[0] < rotor / per_slip < ROTOR_OVER_SLIP[1]


def _ohm_at_slip(metadata: Mapping[str, float | str]) -> float | None:
    """Rated slip times base impedance; None where the plate is not given."""
    keys = ("rated_voltage_v", "rated_current_a", "rated_speed_rpm", "rated_frequency_hz", "pole_pairs")
    values = [metadata.get(k) for k in keys]
    if not all(isinstance(v, float | int) and v > 0 for v in values):
        return None
    voltage, current, speed, frequency, pairs = (float(v) for v in values if v is not None)
    slip = 1.0 - speed * pairs / (60.0 * frequency)
    return slip * voltage / (np.sqrt(3.0) * current) if 0.002 < slip < 0.2 else None


def _left(kind: str, factor: float, ohm: Array, measured_ohm: Array, *, is_locked: bool) -> str:
    star = factor * ohm
    tail = f", {rotor_ohm(star, measured_ohm):.3g} ohm left for the rotor" if is_locked else ""
    return f"{kind}: {float(np.median(star)):.4g} ohm per star phase{tail}"


def _ask(
    name: str, ohm: Array, measured_ohm: Array, possible: list[tuple[str, float]], *, is_locked: bool
) -> DataRefused:
    different = {factor: (kind, factor) for kind, factor in reversed(possible)}
    return refused(
        f"what {name} was measured at is not told, and it matters",
        "; ".join(_left(kind, f, ohm, measured_ohm, is_locked=is_locked) for kind, f in sorted(different.values())),
        "one reading",
        "add `# resistance_measured: line_to_line` (between two terminals), `phase_winding` (with `# connection: star` or "
        "delta) or `star_equivalent` to the table, or name the column winding_resistance_uv_ohm where it is between terminals",
    )


HOW_TO_TELL = (
    "check where the resistance was measured (resistance_measured: line_to_line, phase_winding or star_equivalent), its "
    "unit, and that power_w is of all three phases"
)


def _impossible(
    name: str, ohm: Array, measured_ohm: Array, readings: list[tuple[str, float]], *, is_locked: bool
) -> DataRefused:
    factor, row = min(f for _, f in readings), int(np.argmin(measured_ohm - ohm))
    if factor * ohm[row] >= measured_ohm[row]:
        return refused(
            f"{name} makes more copper loss than the whole power of the point whose P / (3 I^2) is {measured_ohm[row]:.4g} ohm",
            f"{factor * float(ohm[row]):.4g} ohm per star phase",
            f"below {measured_ohm[row]:.4g} ohm",
            HOW_TO_TELL,
        )
    return refused(
        f"{name} does not fit the points, whose P / (3 I^2) is {float(np.median(measured_ohm)):.4g} ohm",
        "; ".join(_left(kind, f, ohm, measured_ohm, is_locked=is_locked) for kind, f in dict(readings).items()),
        f"a rotor resistance of {ROTOR_OVER_STATOR[0]:g} to {ROTOR_OVER_STATOR[1]:g} times the stator's, as the plate's slip "
        "allows" if is_locked else "less copper loss than power",
        HOW_TO_TELL,
    )  # fmt: skip
