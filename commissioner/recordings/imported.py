"""What `recordings import` makes of a file: what was understood as a document, a page with a picture, the contract's form."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import NotRequired

import numpy as np
from typing_extensions import TypedDict

from commissioner.errors import ConfigurationError, DataRefused
from commissioner.monitor.intake.states.stretches import states
from commissioner.recordings.importers import contract_table
from commissioner.recordings.plate import has_no_plate, plate_of
from commissioner.recordings.reading.mapping import ChannelMap
from commissioner.recordings.sheet_names import is_sheet
from commissioner.recordings.table import (
    CONTRACT_COLUMNS,
    ColumnReading,
    Table,
    check_ending,
    sample_period,
    to_currents,
    to_running,
    write_table,
)
from commissioner.recordings.whole import write_text
from commissioner.records import ReadingNote
from commissioner.report import band
from commissioner.report.page import BLUE, GREEN, ORANGE, PLOT_STYLE, Page, Picture, Section, picture, render
from commissioner.report.page import Table as Rows

MOST_DRAWN = 4000
OF_NO_USE = ReadingNote(
    "unknown_kind",
    "nothing here was taken for a voltage: from currents alone `commissioner monitor` tells what it can, `identify` and `diagnose` nothing; name the columns (--map FILE.toml, `commissioner docs formats`) or export them with units in the header",
)
"""Said where the columns do not say what was measured."""


class ColumnRow(TypedDict):
    """A column of the file: what it was taken as (null: not used), its unit there, the factor to SI, and what it holds, as text."""

    name: str
    meaning: str | None
    unit: str
    factor: float
    rms: NotRequired[str]
    range: NotRequired[str]


class StateRow(TypedDict):
    """A stretch of the recording, in its own time; `current_a`: rms."""

    state: str
    start_s: float
    end_s: float
    current_a: float


class Understood(TypedDict):
    """What `recordings import` prints. `kind`: standstill | running | points | unknown; `files`: what was written."""

    file: str
    kind: str
    rows: int
    sample_period_s: float | None
    columns: list[ColumnRow]
    metadata: dict[str, float | str]
    changes: list[ReadingNote]
    states: list[StateRow]
    phase_order: dict[str, str]
    files: NotRequired[dict[str, str]]


def understand(path: Path, mapping: ChannelMap | None = None) -> tuple[Table, Understood]:
    """(the table in SI, what was understood of it). Raises what `contract_table` raises."""
    table = contract_table(path, mapping)
    time = table.columns.get("time_s")
    period = None
    if time is not None and time.size > 1:
        period = sample_period(table, table.columns.get("segment", np.zeros(time.size)))
    kind = kind_of(table)
    return table, {
        "file": str(path),
        "kind": kind,
        "rows": 0 if time is None else int(time.size),
        "sample_period_s": period,
        "columns": [_column(table, r) for r in table.readings],
        "metadata": dict(table.metadata),
        "changes": [*table.notes, *([OF_NO_USE] if kind == "unknown" else [])],
        "states": _states(table, period),
        "phase_order": {kind: order for kind in ("current", "voltage") if (order := _order(table, kind, period))},
    }


def kind_of(table: Table) -> str:
    """`standstill`, `running`, `points`, or `unknown` where the columns do not say."""
    names = set(table.columns)
    if "voltage_axis_v" in names:
        return "standstill"
    if "time_s" not in names and (is_sheet(names & CONTRACT_COLUMNS) or {"frequency_hz", "voltage_line_v"} <= names):
        return "points"
    return "running" if any(n.startswith("voltage_") for n in names & CONTRACT_COLUMNS) else "unknown"


def store(table: Table, document: Understood, out: Path) -> dict[str, str]:
    """Writes the contract's form to `out`, with what was changed among its keys, and a page with the picture beside it."""
    check_ending(out)
    kept = {name: values for name, values in table.columns.items() if name in CONTRACT_COLUMNS}
    changes = "; ".join(change.what for change in document["changes"])
    metadata = {k: v for k, v in table.metadata.items() if ":" not in k and "\n" not in str(v)}
    metadata |= {"imported_from": Path(table.source).name} | ({"import_changes": changes} if changes else {})
    write_table(out, kept, metadata)
    page = out.with_name(out.name.split(".")[0] + "_import.html")
    write_text(page, render(page_of(table, document)))
    return {"recording": str(out), "picture": str(page)}


def page_of(table: Table, document: Understood) -> Page:
    """The page: every column as it was taken, what was changed, the signals over time."""
    rows = [
        (c["name"], c["meaning"] or "not used", c["unit"], f"{c['factor']:g}", c.get("rms", ""))
        for c in document["columns"]
    ]
    said = [change.what for change in document["changes"]] or ["Nothing was changed."]
    parts: list[str | Rows | Picture] = [Rows(("column", "taken as", "unit", "factor to SI", "rms"), rows), *said]
    pictures: list[str | Rows | Picture] = [p for p in (_drawn(table, document["states"]),) if p is not None]
    period = document["sample_period_s"]
    facts = [
        ("kind", document["kind"]),
        ("rows", str(document["rows"])),
        ("sample period", f"{period:.6g} s" if period else "-"),
    ]
    sections = [Section("Columns", *parts), *([Section("Signals", *pictures)] if pictures else [])]
    return Page("Recording", Path(table.source).name, "plain", facts, sections)


def _states(table: Table, period: float | None) -> list[StateRow]:
    """The stretches of a recording over time; nothing of tables that are none."""
    if period is None or "time_s" not in table.columns:
        return []
    if "voltage_axis_v" in table.columns:
        return _at_standstill(table)
    try:
        recording = to_running(table) if kind_of(table) == "running" else to_currents(table)
        known = None if has_no_plate(table.metadata) else plate_of(table.metadata, table.source, None)
    except (DataRefused, ConfigurationError):
        return []
    return [
        {"state": s.state, "start_s": s.start_s, "end_s": s.end_s, "current_a": s.current_a}
        for s in states(recording, known)
    ]


def _at_standstill(table: Table) -> list[StateRow]:
    """Of each segment: off without voltage and current, residual with current alone, else standstill; lost between them."""
    time, volts = table.columns["time_s"], np.nan_to_num(table.columns["voltage_axis_v"])
    segment = table.columns.get("segment", np.zeros(time.size))
    currents = [np.abs(np.nan_to_num(v)) for n, v in table.columns.items() if n.startswith("current_")]
    size = np.max(currents, axis=0) if currents else np.zeros(time.size)
    edges = [0, *(np.flatnonzero(np.diff(segment) != 0.0) + 1).tolist(), time.size]
    out: list[StateRow] = []
    for a, b in pairwise(edges):
        is_on, flows = bool(np.any(volts[a:b])), bool(size[a:b].max() > 0.02 * max(size.max(), 1e-12))
        name = "standstill" if is_on else "residual" if flows else "off"
        begin, end = float(time[a]), float(time[b - 1])
        if out and begin < out[-1]["end_s"]:
            return []
        out.append(
            {"state": name, "start_s": begin, "end_s": end, "current_a": float(np.sqrt(np.mean(size[a:b] ** 2)))}
        )
    return out


def _column(table: Table, reading: ColumnReading) -> ColumnRow:
    row: ColumnRow = {"name": reading.name, "meaning": reading.meaning, "unit": reading.unit, "factor": reading.factor}
    values = table.columns.get(reading.meaning or "")
    good = values[np.isfinite(values)] if values is not None else np.zeros(0)
    if good.size and reading.meaning not in ("time_s", "segment", "axis_deg"):
        row["rms"] = f"{np.sqrt(np.mean(good**2)):.4g}"
        row["range"] = f"{good.min():.4g} ... {good.max():.4g}"
    return row


def _order(table: Table, kind: str, period: float | None) -> str | None:
    """`u-v-w` or `u-w-v` of the three phases at their strongest common line; None where there are not three."""
    ending = "a" if kind == "current" else "v"
    groups = [[f"{kind}_{p}_{ending}" for p in phases] for phases in ("uvw", ("uv", "vw", "wu"))]
    group = next((g for g in groups if all(n in table.columns for n in g)), None)
    if group is None or period is None or "voltage_axis_v" in table.columns:
        return None
    signals = [np.nan_to_num(table.columns[n] - np.nanmean(table.columns[n])) for n in group]
    spectra = [np.fft.rfft(s * np.hanning(s.size)) for s in signals]
    at = int(np.argmax(np.sum([np.abs(s) ** 2 for s in spectra], axis=0)))
    a = np.exp(2j * np.pi / 3)
    u, v, w = (complex(s[at]) for s in spectra)
    forward, backward = abs(u + a * v + a * a * w), abs(u + a * a * v + a * w)
    return "u-v-w" if forward > 2 * backward else "u-w-v" if backward > 2 * forward else None


def _drawn(table: Table, stretches: list[StateRow]) -> Picture | None:
    import matplotlib as mpl
    from matplotlib.figure import Figure

    time = table.columns.get("time_s")
    groups = [
        sorted(n for n in table.columns if n in CONTRACT_COLUMNS and n.startswith(k)) for k in ("current_", "voltage_")
    ]
    groups = [g for g in groups if g]
    if time is None or not groups:
        return None
    step = max(1, time.size // MOST_DRAWN)
    with mpl.rc_context(PLOT_STYLE):
        has_band = len(stretches) > 0 and stretches[-1]["end_s"] > stretches[0]["start_s"]
        rows = len(groups) + has_band
        figure = Figure(figsize=(9.0, 2.2 * len(groups) + 0.5 * has_band))
        grid = figure.add_gridspec(rows, 1, height_ratios=[4.0] * len(groups) + [0.6] * has_band)
        for k, group in enumerate(groups):
            axes = figure.add_subplot(grid[k, 0])
            for name, colour in zip(group, (BLUE, ORANGE, GREEN, BLUE, ORANGE, GREEN), strict=False):
                axes.plot(time[::step], table.columns[name][::step], color=colour, label=name, linewidth=0.8)
            axes.set_ylabel("A" if group[0].startswith("current") else "V")
            axes.legend(loc="upper right")
            if has_band:
                axes.set_xlim(stretches[0]["start_s"], stretches[-1]["end_s"])
        if has_band:
            band.draw(figure.add_subplot(grid[-1, 0]), stretches)
        figure.axes[-1].set_xlabel("time, s")
        return picture(
            figure,
            "The signals as they were understood, in SI units; below them what state the motor was in.",
            raster=True,
        )
