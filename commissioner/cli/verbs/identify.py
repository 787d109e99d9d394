"""`commissioner identify FILE...`: the motor's parameters from standstill recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from commissioner.cli.screens import screen
from commissioner.errors import UsageError

if TYPE_CHECKING:
    from commissioner.motor.nameplate import Nameplate
    from commissioner.records import StandstillRecording

ROWS = (
    ("stator resistance R_s", "stator_resistance_ohm", "ohm", 1.0),
    ("rotor resistance R_R", "rotor_resistance_ohm", "ohm", 1.0),
    ("leakage inductance L_sigma", "leakage_inductance_h", "mH", 1e3),
    ("magnetizing inductance L_M", "magnetizing_inductance_h", "mH", 1e3),
    ("rotor time constant", "rotor_time_constant_s", "s", 1.0),
)


def identify(
    files: Sequence[Path], *, motor: str | None, estimator: str, as_json: bool, mapping: Path | None = None
) -> None:
    """Identify a motor from standstill recordings, with the estimators a live run uses."""
    from commissioner.identify.analysis import identify as analyse

    with screen.busy("identifying"):
        document: dict[str, Any] = analyse(_recording(files, mapping), _nameplate(motor), estimator).as_json()  # type: ignore[arg-type]
    if as_json:
        screen.emit(document | {"flux_guard": _flux_reached(document), "written": []})
    else:
        show(document, [str(path) for path in files])


def _flux_reached(document: Mapping[str, Any]) -> dict[str, Any]:
    """As a run's: the largest flux of the recording, of the limit that the shipped procedure would have had."""
    from commissioner.settings import load_procedure

    limit_wb = load_procedure().limits.flux_fraction * document["rated_flux_wb"]["stator_peak"]
    peak_wb = max(axis["peak_stator_flux_wb"] for axis in document["axes"])
    return {"peak_fraction": peak_wb / limit_wb, "acted": False, "limit_wb": limit_wb}


def identify_and_write(
    files: Sequence[Path], *, motor: str | None, estimator: str, drive: str | None, profile: str | None, yes: bool,
    procedure: Path | None, runs: Path, as_json: bool, mapping: Path | None = None,
) -> None:  # fmt: skip
    """As `identify`; then the verdict, and an accepted result into the drive. Exits with the code of the outcome."""
    from commissioner.cli.screens.live import LiveView
    from commissioner.cli.verbs.run import show_and_exit
    from commissioner.identify.analysis import identify as analyse
    from commissioner.identify.intake.plate import nameplate_from
    from commissioner.run.write_recorded import write_recorded
    from commissioner.settings import load_procedure

    if drive is None or profile is None:
        raise UsageError(
            "--write-back needs to know the drive", step="command line", value=None, limit="--drive URL --profile NAME",
            remedy="add both; `commissioner check` shows whether they fit",
        )  # fmt: skip
    screen.require_yes(yes, as_json=as_json)
    plan = load_procedure(procedure)
    with screen.busy("identifying"):
        recording = _recording(files, mapping)
        plate = _nameplate(motor) or nameplate_from(recording.metadata)
        found = analyse(recording, plate, estimator)  # type: ignore[arg-type]
    if not as_json:
        show(found.as_json(), [str(path) for path in files])
    if not yes:
        screen.out.print(f"If the result is accepted it will be written into the drive at {drive} and stored.")
        screen.confirm("Write?", otherwise="nothing was written")
    with LiveView(screen.err if as_json else screen.out) as view:
        done = write_recorded(drive, profile, plate, plan, found, files, runs=runs, present=view)
    show_and_exit(done, as_json=as_json)


def _recording(files: Sequence[Path], mapping: Path | None) -> StandstillRecording:
    from commissioner.recordings.importers import contract_table
    from commissioner.recordings.reading.mapping import read_mapping
    from commissioner.recordings.table import to_standstill

    said = read_mapping(mapping) if mapping else None
    return joined([to_standstill(contract_table(path, said)) for path in files])


def _nameplate(motor: str | None) -> Nameplate | None:
    if motor is None:
        return None
    from commissioner.settings import load_motor

    return load_motor(motor)


def joined(recordings: Sequence[StandstillRecording]) -> StandstillRecording:
    """Several recordings of one motor as one, in the order given; their segments are renumbered and time runs on."""
    import numpy as np

    from commissioner.errors import DataRefused
    from commissioner.records import StandstillRecording

    first = recordings[0]
    if len(recordings) == 1:
        return first
    for other in recordings[1:]:
        if abs(other.sample_period_s / first.sample_period_s - 1.0) > 1e-6:
            raise DataRefused(
                f"{other.source}: sampled at another rate than {first.source}",
                step="join recordings",
                value=other.sample_period_s,
                limit=first.sample_period_s,
                remedy="identify the files one by one",
            )
    has_w = all(r.current_w_a is not None for r in recordings)
    has_link = all(r.dc_link_v is not None for r in recordings)
    time, segment, time_offset, segment_offset = [], [], 0.0, 0
    for r in recordings:
        time.append(r.time_s - r.time_s[0] + time_offset)
        segment.append(r.segment - r.segment.min() + segment_offset)
        time_offset = float(time[-1][-1]) + 10.0
        segment_offset = int(segment[-1].max()) + 1
    return StandstillRecording(
        time_s=np.concatenate(time),
        segment=np.concatenate(segment),
        axis_deg=np.concatenate([r.axis_deg for r in recordings]),
        voltage_axis_v=np.concatenate([r.voltage_axis_v for r in recordings]),
        current_u_a=np.concatenate([r.current_u_a for r in recordings]),
        current_v_a=np.concatenate([r.current_v_a for r in recordings]),
        current_w_a=np.concatenate([r.current_w_a for r in recordings if r.current_w_a is not None]) if has_w else None,
        dc_link_v=np.concatenate([r.dc_link_v for r in recordings if r.dc_link_v is not None]) if has_link else None,
        sample_period_s=first.sample_period_s,
        metadata=first.metadata,
        source=", ".join(r.source for r in recordings),
        notes=tuple(dict.fromkeys(note for r in recordings for note in r.notes)),
    )


def show(document: Mapping[str, Any], sources: Sequence[str]) -> None:
    """The result as a table for a technician, with what holds for which flux, and the remarks."""
    from rich.console import Console
    from rich.table import Table

    console = Console()
    table = Table(title="Identified from " + ", ".join(sources), title_justify="left")
    for heading in ("per phase, star equivalent", "value", "std error", "unit"):
        table.add_column(heading, justify="left" if heading in ("per phase, star equivalent", "unit") else "right")
    for label, key, unit, factor in ROWS:
        quantity = document["parameters"][key]
        value, std = factor * quantity["value"], factor * quantity["std"]
        table.add_row(label, f"{value:.5g}", f"{std:.2g} ({std / value:.2%})", unit)
    console.print(table)
    flux = document["holds_for_stator_flux_wb"]
    rated = document["rated_flux_wb"]["stator_peak"]
    console.print(f"L_M holds for {flux:.3g} Wb peak stator flux ({flux / rated:.0%} of rated {rated:.3g} Wb).")
    inverter = document["inverter"]
    if inverter["identified"]:
        console.print(
            f"Inverter: each leg loses {inverter['leg_error_v']['value']:.2f} V (knee {inverter['knee_a']:.2g} A)."
        )
    white = [a["whiteness"]["is_white"] for a in document["axes"]]
    console.print(
        f"{len(white)} axis test(s), {document['duration_s']:.1f} s energised, residual white in {sum(white)}; "
        f"{document['gaps']['lost_samples']} samples lost in {document['gaps']['count']} gaps."
    )
    for finding in document["findings"]:
        console.print(f"- {finding['sentence']}: {finding['relative_size']:+.2%} (std {finding['relative_std']:.2%})")
    for remark in document["remarks"]:
        console.print(f"- {remark}")
