"""What `recordings import` makes of a file: what was understood as a document, a page with a picture, the contract's form."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from commissioner.recordings.importers import contract_table
from commissioner.recordings.reading.mapping import ChannelMap
from commissioner.recordings.table import CONTRACT_COLUMNS, Table, check_ending, sample_period, write_table
from commissioner.recordings.whole import whole_file
from commissioner.report.page import BLUE, GREEN, ORANGE, PLOT_STYLE, Page, Picture, Section, picture, render
from commissioner.report.page import Table as Rows

MOST_DRAWN = 4000


def understand(path: Path, mapping: ChannelMap | None = None) -> tuple[Table, dict[str, Any]]:
    """(the table in SI, what was understood of it). Raises what `contract_table` raises."""
    table = contract_table(path, mapping)
    time = table.columns.get("time_s")
    period = None
    if time is not None and time.size > 1:
        period = sample_period(table, table.columns.get("segment", np.zeros(time.size)))
    columns = [
        {"name": r.name, "meaning": r.meaning, "unit": r.unit, "factor": r.factor, **_range(table, r.meaning)}
        for r in table.readings
    ]
    return table, {
        "file": str(path),
        "kind": kind_of(table),
        "rows": 0 if time is None else int(time.size),
        "sample_period_s": period,
        "columns": columns,
        "metadata": dict(table.metadata),
        "changes": [{"code": note.code, "what": note.what} for note in table.notes],
        "phase_order": {kind: order for kind in ("current", "voltage") if (order := _order(table, kind, period))},
    }


def kind_of(table: Table) -> str:
    """`standstill`, `running`, `points`, or `unknown` where the columns do not say."""
    names = set(table.columns)
    if "voltage_axis_v" in names:
        return "standstill"
    if {"frequency_hz", "voltage_line_v"} <= names and "time_s" not in names:
        return "points"
    return "running" if any(n.startswith("voltage_") for n in names & CONTRACT_COLUMNS) else "unknown"


def store(table: Table, document: Mapping[str, Any], out: Path) -> dict[str, str]:
    """Writes the contract's form to `out`, with what was changed among its keys, and a page with the picture beside it."""
    check_ending(out)
    kept = {name: values for name, values in table.columns.items() if name in CONTRACT_COLUMNS}
    changes = "; ".join(change["what"] for change in document["changes"])
    metadata = {k: v for k, v in table.metadata.items() if ":" not in k and "\n" not in str(v)}
    metadata |= {"imported_from": Path(table.source).name} | ({"import_changes": changes} if changes else {})
    write_table(out, kept, metadata)
    page = out.with_name(out.name.split(".")[0] + "_import.html")
    with whole_file(page) as temporary:
        temporary.write_text(render(page_of(table, document)), encoding="utf-8")
    return {"recording": str(out), "picture": str(page)}


def page_of(table: Table, document: Mapping[str, Any]) -> Page:
    """The page: every column as it was taken, what was changed, the signals over time."""
    rows = [
        (c["name"], c["meaning"] or "not used", c["unit"], f"{c['factor']:g}", c.get("rms", ""))
        for c in document["columns"]
    ]
    said = [change["what"] for change in document["changes"]] or ["Nothing was changed."]
    parts: list[str | Rows | Picture] = [Rows(("column", "taken as", "unit", "factor to SI", "rms"), rows), *said]
    pictures: list[str | Rows | Picture] = [p for p in (_drawn(table),) if p is not None]
    period = document["sample_period_s"]
    facts = [
        ("kind", document["kind"]),
        ("rows", str(document["rows"])),
        ("sample period", f"{period:.6g} s" if period else "-"),
    ]
    sections = [Section("Columns", parts), *([Section("Signals", pictures)] if pictures else [])]
    return Page("Recording", Path(table.source).name, "plain", facts, sections)


def _range(table: Table, meaning: str | None) -> dict[str, str]:
    values = table.columns.get(meaning or "")
    good = values[np.isfinite(values)] if values is not None else np.zeros(0)
    if not good.size or meaning in ("time_s", "segment", "axis_deg"):
        return {}
    return {"rms": f"{np.sqrt(np.mean(good**2)):.4g}", "range": f"{good.min():.4g} ... {good.max():.4g}"}


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


def _drawn(table: Table) -> Picture | None:
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
        figure = Figure(figsize=(9.0, 2.2 * len(groups)))
        for k, group in enumerate(groups):
            axes = figure.add_subplot(len(groups), 1, k + 1)
            for name, colour in zip(group, (BLUE, ORANGE, GREEN, BLUE, ORANGE, GREEN), strict=False):
                axes.plot(time[::step], table.columns[name][::step], color=colour, label=name, linewidth=0.8)
            axes.set_ylabel("A" if group[0].startswith("current") else "V")
            axes.legend(loc="upper right")
        figure.axes[-1].set_xlabel("time, s")
        return picture(figure, "The signals as they were understood, in SI units.", raster=True)
