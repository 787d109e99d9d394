"""Channels that nobody named, told by their signals where the plate is known: three currents and three voltages with units, in their
order, that only one reading lets belong to this plate. What is ambiguous is left to be asked for."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from commissioner.motor.nameplate import Nameplate, prior
from commissioner.recordings.table import CONTRACT_COLUMNS, Table
from commissioner.recordings.units import read_unit
from commissioner.records import ReadingNote, Signal

UNNAMED, TOLD = "unnamed_channel", "named_by_signals"
BALANCED = 0.15
"""Of a group's positive or negative sequence, at most in the other and in the zero sequence."""
VOLTS_WITHIN = 1.25
"""Of the plate's voltage at the frequency found, either way: line and phase voltages are 1.73 apart."""
LAG_WITHIN_DEG = 29.0
"""Of the current's lag in the plate's motor at that current: other orders and signs of three channels are 60 degrees apart."""
CURRENTS = tuple(f"current_{p}_a" for p in "uvw")
VOLTAGES = {
    "line": ("voltage_uv_v", "voltage_vw_v", "voltage_wu_v"),
    "phase": ("voltage_u_v", "voltage_v_v", "voltage_w_v"),
}
HANN_LINE = 1.5
"""Power of a line's bins together, of its amplitude's square."""
SLIPS = np.concatenate([[0.0], np.geomspace(1e-4, 1.0, 400)])


@dataclass(frozen=True)
class _Group:
    """Three channels: names, factors to SI, phasors (peak) of the supply, and which way they turn."""

    names: tuple[str, ...]
    factors: tuple[float, ...]
    phasors: Signal
    turn: int


def told_by_signals(table: Table, plate: Nameplate) -> Table:
    """The table with its six unnamed channels under the contract's names and a note of it; as it is where they do not tell."""
    found = _groups(table)
    if found is None:
        return table
    amps, volts, supply_hz = found
    ours = [kind for kind in VOLTAGES if _belongs(kind, amps, volts, supply_hz, plate)]
    if amps.turn != volts.turn or len(ours) != 1:
        return table
    kind = ours[0]
    targets = (*CURRENTS, *VOLTAGES[kind])
    names, factors = (*amps.names, *volts.names), (*amps.factors, *volts.factors)
    meant = dict(zip(names, zip(targets, factors, strict=True), strict=True))
    columns = {name: values for name, values in table.columns.items() if name not in meant}
    columns |= {target: factor * table.columns[name] for name, (target, factor) in meant.items()}
    readings = tuple(
        replace(r, meaning=meant[r.name][0], factor=meant[r.name][1]) if r.name in meant else r for r in table.readings
    )
    line_v = _line_v(kind, volts)
    said = (
        f"{', '.join(names)}: names say nothing; taken in their order as the currents u, v, w and the {'line-to-line' if kind == 'line' else 'phase'} "
        f"voltages {', '.join(t.split('_')[1] for t in VOLTAGES[kind])}: so it is {line_v:.3g} V line to line at {supply_hz:.3g} Hz with the current "
        f"{_lag_deg(kind, amps, volts):.0f} degrees behind, and of every other reading the plate's motor is further off; say otherwise by --map"
    )
    kept = [n for n in table.notes if not (n.code == UNNAMED and n.what.split(":")[0] in names)]
    return Table(columns, table.metadata, table.source, (*kept, ReadingNote(TOLD, said)), readings)


def _groups(table: Table) -> tuple[_Group, _Group, float] | None:
    """Three unnamed channels in amperes, three in volts, each balanced, beside a time and nothing of the contract's signals."""
    unnamed = {n.what.split(":")[0] for n in table.notes if n.code == UNNAMED}
    taken = [n for n in table.columns if n in CONTRACT_COLUMNS and n.startswith(("current_", "voltage_"))]
    time = table.columns.get("time_s")
    if taken or len(unnamed) != 6 or time is None or time.size < 64:
        return None
    readings = [(r, read_unit(r.unit)) for r in table.readings if r.name in unnamed]
    if any(unit is None or unit.is_ambiguous for _, unit in readings):
        return None
    of = {m: [(r.name, u.scale) for r, u in readings if u and u.measures == m] for m in ("current", "voltage")}
    if any(len(group) != 3 for group in of.values()):
        return None
    signals = {name: np.nan_to_num(scale * table.columns[name]) for group in of.values() for name, scale in group}
    window = np.hanning(time.size)
    spectra = {name: np.fft.rfft((x - x.mean()) * window) / (0.5 * window.sum()) for name, x in signals.items()}
    power = np.sum([np.abs(spectra[name]) ** 2 for name, _ in of["voltage"]], axis=0)
    at = int(np.argmax(power))
    span_s = float(time[-1] - time[0]) * time.size / (time.size - 1)
    groups = [_group(of[m], spectra, at) for m in ("current", "voltage")]
    if at < 2 or at + 2 >= power.size or not span_s > 0.0 or groups[0] is None or groups[1] is None:
        return None
    line = power[at - 2 : at + 3]  # between two bins a line of this window is lower by up to 1.4 dB
    rise = np.sqrt(line.sum() / HANN_LINE / power[at])
    amps, volts = (replace(g, phasors=rise * g.phasors) for g in groups if g is not None)
    return amps, volts, float(line @ np.arange(at - 2, at + 3)) / float(line.sum()) / span_s


def _group(channels: list[tuple[str, float]], spectra: dict[str, Signal], at: int) -> _Group | None:
    phasors = np.array([spectra[name][at] for name, _ in channels])
    a = np.exp(2j * np.pi / 3.0)
    forward, backward, zero = (abs(phasors @ np.array(w)) / 3.0 for w in ((1, a, a * a), (1, a * a, a), (1, 1, 1)))
    larger, smaller = max(forward, backward), min(forward, backward)
    if not larger > 0.0 or max(smaller, zero) > BALANCED * larger:
        return None
    names, scales = zip(*channels, strict=True)
    return _Group(tuple(names), tuple(scales), phasors, 1 if forward > backward else -1)


def _lag_deg(kind: str, amps: _Group, volts: _Group) -> float:
    """Of the current behind the phase voltage."""
    apart = np.degrees(np.angle(volts.phasors[0] / amps.phasors[0])) - (30.0 * volts.turn if kind == "line" else 0.0)
    return float((apart + 180.0) % 360.0 - 180.0)


def _line_v(kind: str, volts: _Group) -> float:
    return float(np.mean(np.abs(volts.phasors)) / np.sqrt(2.0) * (1.0 if kind == "line" else np.sqrt(3.0)))


def _belongs(kind: str, amps: _Group, volts: _Group, supply_hz: float, plate: Nameplate) -> bool:
    """Whether so read voltage and lag are those of the plate's motor at this frequency and current."""
    line_v = _line_v(kind, volts)
    expected_v = plate.rated_voltage_v * min(supply_hz / plate.rated_frequency_hz, 1.0)
    if not 1.0 / VOLTS_WITHIN < line_v / expected_v < VOLTS_WITHIN:
        return False
    typical, w = prior(plate).typical, 2.0 * np.pi * supply_hz
    magnetizing = 1j * w * typical.magnetizing_inductance_h
    rotor = SLIPS * magnetizing / (typical.rotor_resistance_ohm + SLIPS * magnetizing)
    impedance = typical.stator_resistance_ohm + 1j * w * typical.leakage_inductance_h + magnetizing * (1.0 - rotor)
    current_a = line_v / np.sqrt(3.0) / np.abs(impedance)
    at = int(np.argmin(np.abs(current_a - np.mean(np.abs(amps.phasors)) / np.sqrt(2.0))))
    return bool(abs(_lag_deg(kind, amps, volts) - np.degrees(np.angle(impedance[at]))) < LAG_WITHIN_DEG)
