"""Voltages and currents as components of their vectors, as the contract's: of phases, and along the axis of a standstill test."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from commissioner.errors import DataRefused
from commissioner.records import ReadingNote, Signal

MOST_ACROSS = 0.2
"""Of the voltage along the axis: what of it may lie across, by dead time and by ripple. A wrong axis by 12 degrees is more."""
TURN_RAD = 6.2832


def with_phases(columns: Mapping[str, Signal]) -> tuple[dict[str, Signal], list[ReadingNote]]:
    """The columns with phases in place of alpha and beta, where no phase is there: alpha is phase u, peaks stay peaks."""
    out, notes = dict(columns), []
    for kind, unit in (("current", "a"), ("voltage", "v")):
        alpha, beta = (out.get(f"{kind}_{name}_{unit}") for name in ("alpha", "beta"))
        if alpha is None or beta is None or any(f"{kind}_{phase}_{unit}" in out for phase in ("u", "v", "w", "axis")):
            continue
        u, v = f"{kind}_u_{unit}", f"{kind}_v_{unit}"
        out[u], out[v] = alpha, (np.sqrt(3.0) * beta - alpha) / 2.0
        if kind == "voltage":
            out["voltage_w_v"] = -(out[u] + out[v])
        del out[f"{kind}_alpha_{unit}"], out[f"{kind}_beta_{unit}"]
        notes.append(
            ReadingNote("components", f"the {kind}s are alpha and beta: taken with alpha as phase u and as large as it")
        )
    return out, notes


def along_axis(columns: Mapping[str, Signal], source: str) -> tuple[dict[str, Signal], list[ReadingNote]]:
    """The columns of a standstill test with `voltage_axis_v` in place of the voltages of phases or between lines. DataRefused: these do
    not lie along its axis."""
    axis = columns.get("axis_deg")
    if axis is None or "segment" not in columns or "voltage_axis_v" in columns:
        return dict(columns), []
    if (voltage := _voltage_vector(columns)) is None:
        return dict(columns), []
    turned = voltage * np.exp(-1j * np.deg2rad(axis))
    along, across = turned.real, turned.imag
    part = float(np.sqrt(np.nanmean(across**2) / max(float(np.nanmean(along**2)), 1e-12)))
    if part > MOST_ACROSS:
        raise DataRefused(
            f"{source}: the voltages of the phases do not lie along axis_deg", step="recognise columns", value=f"{part:.2g} of the voltage lies across",
            limit=MOST_ACROSS, remedy="give axis_deg in electrical degrees from phase u, and the phases by their names; or voltage_axis_v",
        )  # fmt: skip
    kept = {name: v for name, v in columns.items() if name not in _USED}
    note = ReadingNote("components", "the voltage along the axis is the part of the phases' voltages along axis_deg")
    return {**kept, "voltage_axis_v": along}, [note]


def require_degrees(axis_deg: Signal, source: str) -> None:
    """DataRefused: several axes lie within two pi, as axes in radians or in turns do and axes of a test never."""
    axes = np.unique(axis_deg)
    if axes.size > 1 and float(np.abs(axes).max()) < TURN_RAD:
        raise DataRefused(
            f"{source}: the axes look like radians or turns, not degrees", step="read recording", value=", ".join(f"{a:.4g}" for a in axes[:6]),
            limit="electrical degrees, axes spread over the turn", remedy="give axis_deg in degrees, or name the unit: `axis [rad]`, `axis [turns]`",
        )  # fmt: skip


def with_segment(columns: Mapping[str, Signal], source: str) -> tuple[dict[str, Signal], list[ReadingNote]]:
    """The columns of a standstill test with one segment where none is given, for one axis and a time without gaps. DataRefused: there
    are several axes, or gaps."""
    if "segment" in columns or not {"time_s", "axis_deg", "voltage_axis_v"} <= set(columns):
        return dict(columns), []
    steps = np.diff(columns["time_s"])
    gaps = int(np.sum(~(steps < 1.5 * np.median(steps)))) if steps.size else 0
    axes = np.unique(columns["axis_deg"]).size
    if gaps or axes > 1:
        raise DataRefused(
            f"{source}: the column segment is not there, and the time has gaps or the axis changes", step="read recording",
            value=f"{axes} axes, {gaps} gaps", limit="a segment for each stretch before which the motor was off",
            remedy="add a column segment: 0, 1, 2 ..., a new number wherever the motor was off in between, the same across samples that were only lost",
        )  # fmt: skip
    note = ReadingNote("segment", "no column segment, one axis and a time without gaps: taken as one segment")
    return {**columns, "segment": np.zeros(columns["time_s"].size)}, [note]


def _voltage_vector(columns: Mapping[str, Signal]) -> NDArray[np.complex128] | None:
    """Of the three phases' voltages, or of two between lines; None where they are not there. What all phases share has no part in it."""
    from commissioner.monitor.signals.supply import phase_voltages, space_vector

    u, v, w, uv, vw = (columns.get(name) for name in _USED[:5])
    if u is not None and v is not None and w is not None:
        return space_vector(u, v, w)
    return space_vector(*phase_voltages(uv, vw, -(uv + vw))) if uv is not None and vw is not None else None


_USED = ("voltage_u_v", "voltage_v_v", "voltage_w_v", "voltage_uv_v", "voltage_vw_v", "voltage_wu_v")
