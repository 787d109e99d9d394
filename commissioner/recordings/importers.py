"""Recordings in other people's formats, mapped into the contract's table.

Oscilloscope and logger CSV: any of comma, semicolon, tab; decimal commas; preface lines; a row of units; column names such
as `Ia`, `i_L1`, `Strom U`, `CH1 (mA)`. MATLAB v5: vectors or columns of a matrix under such names, also inside structures.
TDMS, MDF 4 and COMTRADE: channels under such names or the contract's own, by their units.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from commissioner.errors import DataRefused, UsageError
from commissioner.recordings.formats import comtrade, matlab, mdf4, tdms
from commissioner.recordings.formats.foreign_csv import has_other_separators, parse_csv, read_text
from commissioner.recordings.names import is_per_minute, key_of, meaning_of, uses_rst
from commissioner.recordings.table import CONTRACT_COLUMNS, READ, Table, read_table, to_running
from commissioner.recordings.units import scale_of, unit_in
from commissioner.records import RunningRecording, Signal

_BINARY: Mapping[str, Callable[[Path], tuple[dict[str, Signal], dict[str, float | str]]]] = {
    ".mat": lambda path: (matlab.vectors(path), {}),
    ".tdms": tdms.channels,
    ".mf4": lambda path: (mdf4.channels(path), {}),
    ".cfg": comtrade.channels,
    ".dat": comtrade.channels,
    ".cff": comtrade.channels,
}
NOT_READ = {".mdf": "MDF 3", ".xlsx": "Excel", ".xls": "Excel"}


def read_running(path: Path) -> RunningRecording:
    """The recording in `path`, whatever its format; DataRefused names the column that could not be found."""
    return to_running(import_table(path))


def contract_table(path: Path) -> Table:
    """The table of a file whose columns or channels bear the contract's names, in any format that is read."""
    reader = _BINARY.get(path.suffix.lower())
    if reader is None and has_other_separators(path):
        return Table(*parse_csv(read_text(path), str(path)), str(path))
    if reader is None or not path.is_file():
        return read_table(path)
    columns, metadata = reader(path)
    table = _ours(columns, metadata, str(path))
    if table is None:
        raise DataRefused(
            f"{path}: its channels do not bear the contract's names", step="recognise columns", value=_some(columns),
            limit="time_s, segment, axis_deg, voltage_axis_v, current_u_a, current_v_a", remedy="rename the channels",
        )  # fmt: skip
    return table


def import_table(path: Path) -> Table:
    """The table of a contract file as it stands, of any other file after its columns were recognised."""
    if not path.is_file():
        raise UsageError(
            f"there is no file {path}",
            step="read recording",
            value=str(path),
            limit="an existing file",
            remedy="check the path",
        )
    suffix = path.suffix.lower()
    if suffix in NOT_READ:
        raise DataRefused(
            f"{path}: {NOT_READ[suffix]} files are not read",
            step="read recording",
            value=suffix,
            limit=READ,
            remedy="export the recording as CSV or Parquet",
        )
    if suffix in _BINARY:
        columns, metadata = _BINARY[suffix](path)
        return _ours(columns, metadata, str(path)) or recognise(_in_si(columns), metadata, str(path))
    try:
        table = read_table(path)
    except DataRefused as refusal:
        return _foreign_csv(path, refusal)
    if "time_s" in table.columns and any(name.startswith("current_") for name in table.columns):
        return table
    try:
        return recognise(_in_si(table.columns), table.metadata, str(path))
    except DataRefused as refusal:
        return _foreign_csv(path, refusal)


def _ours(columns: Mapping[str, Signal], metadata: Mapping[str, float | str], source: str) -> Table | None:
    """The columns as they stand, where their names are the contract's."""
    bare = {name.rpartition(".")[2].split(" [")[0]: values for name, values in columns.items()}
    named = {name: values for name, values in bare.items() if name in CONTRACT_COLUMNS}
    sizes = {values.size for values in named.values()}
    if len(sizes) != 1 or not any(name.startswith("current_") for name in named):
        return None
    period = metadata.get("sample_period_s")
    if "time_s" not in named and isinstance(period, float):
        named["time_s"] = np.arange(sizes.pop(), dtype=np.float64) * period
    return Table(named, metadata, source) if "time_s" in named else None


def _in_si(columns: Mapping[str, Signal]) -> dict[str, Signal]:
    """Each channel by the unit in its name; a damaged value passes as what it is, for the audit to name."""
    with np.errstate(invalid="ignore", over="ignore"):
        return {name: scale_of(unit_in(name)) * values for name, values in columns.items()}


def _foreign_csv(path: Path, refusal: DataRefused) -> Table:
    """The file read as somebody else's CSV; where that fails too, what was wrong with it as a table stands."""
    if path.suffix.lower() == ".parquet":
        raise refusal
    try:
        columns, metadata = parse_csv(read_text(path), str(path))
    except DataRefused:
        raise refusal from None
    return recognise(columns, metadata, str(path))


def recognise(columns: Mapping[str, Signal], metadata: Mapping[str, float | str], source: str) -> Table:
    """The contract's columns among others' names; time is made from a rate where there is no time column."""
    kept: dict[str, Signal] = {}
    data = dict(metadata)
    for key, number in [*data.items(), *((name, float(v[0])) for name, v in columns.items() if v.size == 1)]:
        found = _period_from(key, number)
        if found is not None:
            data.setdefault("sample_period_s", found)
    with_s = uses_rst(columns)
    for name, values in columns.items():
        meaning = meaning_of(name, with_s)
        if meaning and meaning not in kept and values.size > 1:
            per_minute = meaning == "speed_rad_per_s" and is_per_minute(name) and scale_of(unit_in(name)) == 1.0
            kept[meaning] = values * (np.pi / 30) if per_minute else values
    longest = max((v.size for v in kept.values()), default=0)
    kept = {name: values for name, values in kept.items() if values.size == longest}
    period = data.get("sample_period_s")
    if "time_s" not in kept and isinstance(period, float) and longest:
        kept["time_s"] = np.arange(longest, dtype=np.float64) * period
    missing = _missing(kept)
    if missing:
        raise DataRefused(
            f"{source}: the recording lacks {', '.join(missing)}: speed and torque cannot be reconstructed from it",
            step="recognise columns",
            value=_some(columns),
            limit="time_s, three line currents and three voltages, in SI units",
            remedy="record all six channels against time, or rename the columns to the contract's (time_s, current_u_a, "
            "voltage_u_v or voltage_uv_v ...); without a time column give `# sample_period_s: 0.000125` as the first line",
        )
    return Table(kept, data, source)


def _period_from(name: str, value: float | str) -> float | None:
    """The sample period that a single number beside the columns gives: a rate in hertz, or the period in seconds."""
    if not isinstance(value, float) or not value > 0:
        return None
    key = key_of(name)
    if key in {"fs", "samplerate", "samplingrate", "samplingfrequency", "sampleratehz", "samplingratehz", "fshz"}:
        return 1.0 / value
    return value if key in {"ts", "dt", "tsample", "sampleperiod", "sampleinterval", "samplinginterval"} else None


def _missing(kept: Mapping[str, Signal]) -> list[str]:
    """What of time, currents and voltages is not there, in words; a third current or line-to-line voltage follows from two."""
    out = [] if "time_s" in kept else ["time (a time column or a sample rate)"]
    phases = [phase for phase in "uvw" if f"current_{phase}_a" not in kept]
    if len(phases) > 1:
        out.append("the current" + ("s" if len(phases) > 1 else "") + " of phase " + ", ".join(phases))
    star = all(f"voltage_{phase}_v" in kept for phase in "uvw")
    if not star and sum(f"voltage_{pair}_v" in kept for pair in ("uv", "vw", "wu")) < 2:
        out.append("three phase voltages or two line-to-line voltages")
    return out


def _some(columns: Mapping[str, Signal]) -> str:
    names = list(columns)
    return ", ".join(names[:8]) + (f" ... ({len(names)} columns)" if len(names) > 8 else "")
