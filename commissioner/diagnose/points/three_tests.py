"""The motor from the three tests of a textbook: direct current, no load and locked rotor, one row each or a few.

IEEE 112-2017, 5.9 (impedance test): R_s from direct current, L_s = L_sigma + L_M from no load, L_sigma and R_R from the locked
rotor with the magnetizing branch kept. Which row is which test follows from its frequency and its inductance, and must be what the sheet calls it; nothing is left
over to judge the circuit by, and the result says so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from commissioner.diagnose.intake.points import Array, Points
from commissioner.diagnose.intake.refusal import refused
from commissioner.diagnose.points.bars import SlowRotor, remark_of, slow_rotor
from commissioner.diagnose.points.resistance import column_of, star_resistance, unread
from commissioner.diagnose.points.rows import (
    IDLE_POWER_FACTOR,
    LEAST_COLUMNS,
    Rows,
    called_otherwise,
    joined,
    looks_idle,
    of_direct_current,
    pooled,
)
from commissioner.diagnose.points.table import lacking
from commissioner.errors import DataRefused
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.running import TCircuit
from commissioner.records import IDLE_TEST, LOCKED_TEST, POINT_COLUMNS

UNLIKE = 1.5
"""Of the inductance of the rows called locked rotor, beyond which a row without a name is none: that of 5.5 kW at its rated load in
`tests/unit/recordings/sheets/test_lost_rows.py` has 1.9 times it."""
SPLIT = {"A": 1.0, "B": 0.67, "C": 0.43, "D": 1.0, "N": 1.0}
"""X_1 over X_2 by design class (IEEE 112-2017, table 5; IEC's N as A)."""
LEAST_SEEN = 0.5
"""X over R of a locked rotor from which on its leakage is taken: at 5 Hz, 0.25, 0.3 % of meter noise made 12 % of L_sigma."""
LOW_FREQUENCY = 0.25
"""Of the rated frequency: IEEE 112 wants a locked rotor at no more (5.9.2.1, method 1)."""


@dataclass(frozen=True)
class Losses:
    """What an idle motor takes beyond its copper, W; apart where two voltages tell the iron's share."""

    together_w: float
    friction_w: float | None = None
    iron_w: float | None = None


@dataclass(frozen=True)
class ThreeTests:
    """The circuit of three tests; `textbook`: by the usual approximations (R_1, R_2, X_1, X_2, X_M in ohm at no-load frequency)."""

    circuit: InverseGamma
    t_circuit: TCircuit
    textbook: Mapping[str, float]
    losses: Losses
    slow: SlowRotor | None
    method: str
    assumed: tuple[str, ...]
    rows: Mapping[str, int]
    flux_wb: float
    """Peak stator flux at which L_M holds."""


def solve(
    tables: Sequence[Mapping[str, Array]], metadata: Sequence[Mapping[str, float | str]]
) -> ThreeTests | DataRefused:
    """The circuit, or which test is missing or impossible."""
    if lacks := next((r for t in tables if (r := lacking(t, LEAST_COLUMNS)) is not None), None):
        return lacks
    rows = joined([pooled(t) for t in tables])
    said = {k: v for one in reversed(metadata) for k, v in one.items()}
    direct = of_direct_current(rows)
    ac = rows.at(~direct)
    if (wrong := _wrong_cell(ac)) is not None:
        return wrong
    if (against := called_otherwise(ac, looks_idle(ac))) is not None:
        return against
    idle, locked, assumed = _by_kind(ac)
    if not idle.frequency_hz.size or not locked.frequency_hz.size:
        kind = "no-load and locked-rotor"
        return refused(
            f"these tests hold no pair of {kind} points", f"{ac.frequency_hz.size} points", "one of each at least",
            "give a point of either test in one table, or both tables together",
        )  # fmt: skip
    stator = stator_resistance(rows.at(direct), tables, said, locked)
    if isinstance(stator, DataRefused):
        return stator
    r_s, where = stator
    return _circuit(r_s, idle, locked, said, (where, *assumed), int(np.sum(direct)))


def _circuit(
    r_s: float, idle: Rows, locked: Rows, said: Mapping[str, float | str], assumed: tuple[str, ...], direct: int
) -> ThreeTests | DataRefused:
    best = _nearest(idle.voltage_v, said.get("rated_voltage_v"), float(idle.voltage_v.max()))
    l_s = float(idle.inductance_h[best])
    test = locked.at(locked.frequency_hz == _frequency(locked))
    at = _nearest(test.current_a, said.get("rated_current_a"), float(test.current_a.max()))
    omega = 2.0 * np.pi * float(test.frequency_hz[at])
    rest = complex(test.resistance_ohm[at] - r_s, test.reactance_ohm[at])
    solved = (
        _inverse_gamma(rest, omega, _at_flux(idle, r_s, best, abs(rest) * float(test.current_a[at]) / omega))
        if rest.real > 0.0
        else None
    )
    if solved is None:
        return refused(
            "nothing is left for the rotor in the locked-rotor point", f"P / (3 I^2) {test.resistance_ohm[at]:.4g} ohm",
            f"above the stator's {r_s:.4g} ohm, and a leakage below L_s {l_s:.4g} H",
            "check that power_w is of all three phases, voltages are line to line, and where the direct current flowed",
        )  # fmt: skip
    r_r, l_sigma = solved
    slow = _slow(locked, r_s)
    circuit = InverseGamma(r_s, r_r if slow is None else slow.resistance_ohm, l_sigma, l_s - l_sigma)
    ratio, words = _split(said)
    losses, apart = _losses(idle, r_s, best)
    flux, at_flux = _flux_of(idle, best)
    frequencies = np.unique(locked.frequency_hz).tolist()
    rated = float(said.get("rated_frequency_hz") or idle.frequency_hz[best])
    is_low = min(frequencies) <= 1.001 * LOW_FREQUENCY * rated
    method = "IEEE 112, impedance test, method 1" if is_low else "locked rotor above a quarter of the rated frequency"
    no_error = "Three tests fix the circuit and leave nothing over: no uncertainty can be had from them, and no cause seen or ruled out."
    return ThreeTests(
        circuit, _t_circuit(circuit, ratio), _textbook(r_s, idle, best, test, at, ratio), losses, slow, method,
        (*assumed, words, at_flux, apart, remark_of(slow, frequencies), no_error),
        {"direct current": direct, "no load": idle.frequency_hz.size, "locked rotor": locked.frequency_hz.size}, flux,
    )  # fmt: skip


def _wrong_cell(ac: Rows) -> DataRefused | None:
    for name, values in zip(POINT_COLUMNS, (ac.frequency_hz, ac.voltage_v, ac.current_a, ac.power_w), strict=True):
        wrong = np.flatnonzero(~(np.isfinite(values) & (values > 0)))
        if wrong.size and not np.isfinite(values).any():
            return refused(
                f"{name} of the alternating-current tests is not there", "no number", "a number in every row",
                f"add the column {name}: a locked rotor is often measured at another frequency than the plate's",
            )  # fmt: skip
        if wrong.size:
            return refused(
                f"{name} is {values[wrong[0]]:g} in point {wrong[0] + 1} of the alternating-current tests",
                float(values[wrong[0]]), "positive numbers in every row", "correct the cell or leave the row out",
            )  # fmt: skip
    factor = ac.power_factor
    if factor.size and factor.max() > 1.0:
        k = int(np.argmax(factor))
        return refused(
            f"the power {ac.power_w[k]:.6g} W at {ac.voltage_v[k]:g} V and {ac.current_a[k]:g} A is a power factor of {factor[k]:.3g}",
            float(factor[k]), "at most 1", "give line-to-line volts, line amperes and the watts of all three phases",
        )  # fmt: skip
    return None


def _by_kind(ac: Rows) -> tuple[Rows, Rows, tuple[str, ...]]:
    """No-load points, locked-rotor points, and what was left out: inductances lie in two groups."""
    is_idle = looks_idle(ac)
    if is_idle is None:
        named = np.isfinite(ac.said)
        is_idle, ac = (ac.said == IDLE_TEST)[named], ac.at(named)
        if not np.any(is_idle) or np.all(is_idle):
            is_idle = np.zeros(is_idle.size, dtype=bool)
    named = ac.said == LOCKED_TEST
    most = UNLIKE * float(ac.inductance_h[named].max(initial=0.0)) or np.inf
    loaded = np.where(is_idle, ac.power_factor > IDLE_POWER_FACTOR, np.isnan(ac.said) & (ac.inductance_h > most))
    said = (f"{int(loaded.sum())} points of a loaded motor were not used.",) if loaded.any() else ()
    return ac.at(is_idle & ~loaded), ac.at(~is_idle & ~loaded), said


def stator_resistance(
    direct: Rows, tables: Sequence[Mapping[str, Array]], said: Mapping[str, float | str], locked: Rows
) -> tuple[float, str] | DataRefused:
    """R_s per star phase: half of U / I between two terminals, or what a column or key says."""
    if direct.voltage_v.size:
        ohm = float(np.mean(direct.voltage_v / direct.current_a))
        told = str(said.get("resistance_measured", "")).lower()
        if "star" in told or "phase" in told or "winding" in told:
            given = star_resistance(
                "the direct-current test", np.array([ohm]), locked.resistance_ohm[:1], said, is_locked=True
            )
            if isinstance(given, DataRefused):
                return given
            if given.star_ohm is not None:
                return float(given.star_ohm[0]), f"Direct current as told by resistance_measured: {told}."
        return 0.5 * ohm, "Direct current was taken as flowing between two terminals: R_s is half of U / I."
    for table in tables:
        found = column_of(table, said)
        if isinstance(found, DataRefused):
            return found
        if found is not None and np.isfinite(found[1]).any():
            ohms = np.full(1, float(np.nanmean(found[1])))
            given = star_resistance(found[0], ohms, locked.resistance_ohm[:1], said, is_locked=True)
            if isinstance(given, DataRefused):
                return given
            if given.star_ohm is not None:
                return float(given.star_ohm[0]), " ".join((f"R_s from {found[0]}.", *given.remarks))
    left = dict.fromkeys(name for table in tables for name in unread(table, said))
    return refused(
        "the stator's resistance is not given", f"not understood: {', '.join(left)}" if left else None, "a row of direct current, or winding_resistance_uv_ohm",
        "add the direct-current test (frequency 0, volts and amperes between two terminals)",
    )  # fmt: skip


def _nearest(values: Array, wanted: float | str | None, otherwise: float) -> int:
    return int(np.argmin(np.abs(values - (wanted if isinstance(wanted, float | int) else otherwise))))


def _flux_of(idle: Rows, best: int) -> tuple[float, str]:
    volts, hz = float(idle.voltage_v[best]), float(idle.frequency_hz[best])
    flux = float(np.sqrt(2.0 / 3.0) * volts / (2.0 * np.pi * hz))
    return (
        flux,
        f"L_M is that of the no-load point at {volts:.4g} V and {hz:g} Hz, a stator flux of {flux:.3g} Wb; it falls where iron saturates.",
    )


def _frequency(locked: Rows) -> float:
    """The lowest whose leakage is seen beside the resistance (an error of the watts moves it by the square of Z / X times as much), else the
    highest."""
    seen = locked.reactance_ohm >= LEAST_SEEN * locked.resistance_ohm
    return float(locked.frequency_hz[seen].min() if seen.any() else locked.frequency_hz.max())


def _at_flux(idle: Rows, r_s: float, best: int, flux_wb: float) -> float:
    """L_s at the no-load point whose flux (rms) is nearest: iron is not saturated where the rotor is locked, and the branch that is kept
    there takes the more of the current the lower its frequency. Beside the loss, which a low voltage makes large, not in series with it."""
    omega = 2.0 * np.pi * idle.frequency_hz
    behind = idle.resistance_ohm - r_s + 1j * idle.reactance_ohm
    beside = np.abs(behind) ** 2 / behind.imag / omega
    near = int(np.argmin(np.abs(np.log(np.abs(behind) * idle.current_a / omega / flux_wb))))
    return float(idle.inductance_h[best] * beside[near] / beside[best])


def _inverse_gamma(rest: complex, omega: float, l_s: float) -> tuple[float, float] | None:
    """(R_R, L_sigma) with j w L_sigma + (j w L_M parallel R_R) = rest and L_M = L_s - L_sigma; None where there is none."""
    leak = rest.imag / omega
    for _ in range(60):
        main = omega * (l_s - leak)
        if main <= 2.0 * rest.real:
            return None
        rotor = 0.5 * main * (main - np.sqrt(main**2 - 4.0 * rest.real**2)) / rest.real
        leak = (rest.imag - rotor**2 * main / (rotor**2 + main**2)) / omega
    return (float(rotor), float(leak)) if 0.0 < leak < l_s else None


def _t_circuit(circuit: InverseGamma, ratio: float) -> TCircuit:
    """The T circuit of the same terminals with L_1 = `ratio` L_2."""
    l_main_gamma = circuit.magnetizing_inductance_h
    l_s = circuit.leakage_inductance_h + l_main_gamma
    b = 1.0 - ratio
    main = (np.sqrt(b**2 + 4.0 * ratio * l_s / l_main_gamma) - b) * l_main_gamma / (2.0 * ratio)
    rotor = main**2 / l_main_gamma
    return TCircuit(
        circuit.stator_resistance_ohm, circuit.rotor_resistance_ohm * (rotor / main) ** 2, float(l_s - main),
        float(rotor - main), float(main),
    )  # fmt: skip


def _textbook(r_s: float, idle: Rows, best: int, test: Rows, at: int, ratio: float) -> dict[str, float]:
    """The magnetizing branch of the locked test and the resistance of the idle one neglected."""
    x = float(test.reactance_ohm[at] * idle.frequency_hz[best] / test.frequency_hz[at])
    x_1 = x * ratio / (1.0 + ratio)
    return {
        "r1_ohm": r_s, "r2_ohm": float(test.resistance_ohm[at] - r_s), "x1_ohm": x_1, "x2_ohm": x - x_1,
        "xm_ohm": float(idle.impedance_ohm[best] - x_1), "frequency_hz": float(idle.frequency_hz[best]),
    }  # fmt: skip


def _split(said: Mapping[str, float | str]) -> tuple[float, str]:
    told = str(said.get("design_class", "")).strip().upper().removeprefix("NEMA").strip()
    if told in SPLIT:
        return SPLIT[told], f"Leakages of the T circuit split as of design class {told}: X_1 = {SPLIT[told]:g} X_2."
    return 1.0, (
        "Leakages of the T circuit were taken as equal (design A, D or wound rotor; `# design_class: B` takes X_1 = 0.67 X_2): "
        "terminals cannot tell, the inverse-Gamma circuit does not depend on it."
    )


def _losses(idle: Rows, r_s: float, best: int) -> tuple[Losses, str]:
    beyond = idle.power_w - 3.0 * idle.current_a**2 * r_s
    together = float(beyond[best])
    same = idle.frequency_hz == idle.frequency_hz[best]
    squares = idle.voltage_v[same] ** 2
    if squares.size < 2 or np.ptp(squares) < 0.2 * squares.max():
        return Losses(together), (
            f"{together:.4g} W beyond the copper of the idle motor are iron and friction together: a second no-load voltage would tell."
        )
    iron, friction = np.polyfit(squares, beyond[same], 1)
    at_best = float(iron * idle.voltage_v[best] ** 2)
    if at_best < 0.0 or friction < 0.0:
        return Losses(together), (
            f"{together:.4g} W beyond the copper of the idle motor: no positive iron and friction losses follow from its voltages."
        )
    return Losses(together, float(friction), at_best), (
        f"Losses of the idle motor by its voltages, iron with the square of the voltage: friction {friction:.4g} W, iron {at_best:.4g} W."
    )


def _slow(locked: Rows, r_s: float) -> SlowRotor | None:
    if np.unique(locked.frequency_hz).size < 2:
        return None
    return slow_rotor(
        Points(
            "locked rotor", locked.frequency_hz, locked.voltage_v, locked.current_a, locked.power_w,
            np.full(locked.frequency_hz.size, r_s), True,
        )
    )  # fmt: skip
