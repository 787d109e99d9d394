"""`commissioner diagnose FILE...`: what the simulation gets wrong about recordings or test points, by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from commissioner.errors import DataRefused

if TYPE_CHECKING:
    from commissioner.recordings.table import Table
    from commissioner.records import StandstillRecording

RUNNING_COLUMNS = ("voltage_u_v", "voltage_uv_v", "speed_rad_per_s")
STANDSTILL_COLUMNS = frozenset(
    ["time_s", "segment", "axis_deg", "voltage_axis_v", "current_u_a", "current_v_a", "current_w_a", "dc_link_v"]
)


def diagnose(files: Sequence[Path], motor: str | None = None, out: Path | None = None, as_json: bool = False) -> None:
    """Diagnose recordings of one motor at standstill, or tables of steady-state points.

    With `out`, writes `report.html`, `model.json` and `diagnosis.json` there. Exit code 3 where the data cannot carry
    an answer.
    """
    from commissioner.recordings.importers import contract_table

    tables = [contract_table(Path(path)) for path in files]
    from commissioner.diagnose.points import is_points_table

    if all(is_points_table(list(t.columns)) and "voltage_axis_v" not in t.columns for t in tables):
        _points(tables, out, as_json)
    else:
        _recordings(tables, motor, out, as_json)


def _recordings(tables: Sequence[Table], motor: str | None, out: Path | None, as_json: bool) -> None:
    from commissioner.diagnose.diagnosis import diagnose as analyse
    from commissioner.diagnose.document import as_document

    recordings, remarks = _standstill(tables, motor)
    _same_motor(recordings)
    seen = analyse(recordings, report=_silent if as_json else _progress)
    document = as_document(seen, None)
    document["audit"] = [*remarks, *document["audit"]]
    if out is not None:
        from commissioner.report.diagnose_page import page_of
        from commissioner.report.page import render

        document["model_file"] = str(out / "model.json") if seen.model else None
        page = render(page_of(seen, document, ", ".join(Path(t.source).name for t in tables)))
        _write(out, document, seen.model, page)
    _finish(document, out, as_json)


def _silent(sentence: str) -> None:
    return None


def _progress(sentence: str) -> None:
    from commissioner.cli.screen import err

    err.print(f"[dim]{sentence}[/]")


def _standstill(tables: Sequence[Table], motor: str | None) -> tuple[list[StandstillRecording], list[str]]:
    """The tables as recordings; a running motor is refused, unknown columns are named and left out."""
    from dataclasses import replace

    from commissioner.recordings.table import to_standstill

    remarks, recordings = [], []
    for table in tables:
        running = [c for c in RUNNING_COLUMNS if c in table.columns]
        if running and "voltage_axis_v" not in table.columns:
            raise DataRefused(
                f"{table.source}: this is a recording of a running motor (column {running[0]})", step="diagnose",
                value=", ".join(table.columns), limit="a standstill recording or a table of test points",
                remedy="use `commissioner monitor` for a running motor",
            )
        unknown = sorted(set(table.columns) - STANDSTILL_COLUMNS)
        if unknown:
            remarks.append(f"{Path(table.source).name}: unknown columns left out: {', '.join(unknown)}.")
        recording = to_standstill(table)
        recordings.append(replace(recording, metadata={**recording.metadata, **_plate(motor)}))
    return recordings, remarks


def _plate(motor: str | None) -> dict[str, float | str]:
    if motor is None:
        return {}
    from dataclasses import asdict

    from commissioner.settings import load_motor

    return {k: v for k, v in asdict(load_motor(motor)).items() if v is not None}


def _same_motor(recordings: Sequence[StandstillRecording]) -> None:
    """Files with different plates are not one motor."""
    for key in ("rated_power_w", "rated_voltage_v", "rated_current_a", "rated_frequency_hz"):
        seen = {r.metadata[key]: r.source for r in recordings if key in r.metadata}
        if len(seen) > 1:
            raise DataRefused(
                f"the files are of different motors: {key} is {' and '.join(str(k) for k in seen)}", step="diagnose",
                value=", ".join(seen.values()), limit="recordings of one motor", remedy="diagnose them one by one",
            )
    periods = {r.sample_period_s for r in recordings}
    if max(periods) > 1.000001 * min(periods):
        raise DataRefused(
            "the files are sampled at different rates", step="diagnose", value=", ".join(f"{p:g} s" for p in periods),
            limit="one sample period", remedy="diagnose them one by one",
        )


def _points(tables: Sequence[Table], out: Path | None, as_json: bool) -> None:
    """Each table on its own; the stator resistance of a locked-rotor table serves the others."""
    from commissioner.diagnose.document import points_document, refused_document
    from commissioner.diagnose.points import Points, read_points
    from commissioner.diagnose.points_diagnosis import diagnose_points

    read = [read_points(t.columns, Path(t.source).stem) for t in tables]
    known = [p.resistance_ohm.mean() for p in read if isinstance(p, Points) and p.resistance_ohm is not None]
    documents = []
    for points, table in zip(read, tables, strict=True):
        if isinstance(points, str):
            documents.append(refused_document(f"{table.source}: {points}", "points"))
        else:
            documents.append(points_document(diagnose_points(points, float(known[0]) if known else None)))
    document = documents[0] if len(documents) == 1 else _joined(documents, tables)
    if out is not None and all(d["verdict"] != "refused" for d in documents):
        from commissioner.report.diagnose_page import points_page
        from commissioner.report.page import render

        for one, table in zip(documents, tables, strict=True):
            name = Path(table.source).stem
            _write(out, document, {}, render(points_page(one, name)), page_name=f"report_{name}.html")
    _finish(document, out, as_json)


def _joined(documents: Sequence[dict[str, Any]], tables: Sequence[Table]) -> dict[str, Any]:
    """One document: all causes together, every table's own result under `tables`."""
    verdicts = [d["verdict"] for d in documents]
    order = ("explained", "nothing_significant", "refused")
    verdict = next((v for v in order if v in verdicts), verdicts[0])
    return {
        **documents[0],
        "verdict": verdict,
        "reason": " ".join(d["reason"] for d in documents),
        "causes": [c for d in documents for c in d["causes"]],
        "tables": {Path(t.source).name: d for t, d in zip(tables, documents, strict=True)},
    }


def _write(
    out: Path, document: Mapping[str, Any], model: Mapping[str, Any], page: str, page_name: str = "report.html"
) -> None:
    import json

    from commissioner.run.archive import plain

    out.mkdir(parents=True, exist_ok=True)
    (out / page_name).write_text(page, encoding="utf-8")
    (out / "diagnosis.json").write_text(json.dumps(plain(document), indent=2), encoding="utf-8")
    if model:
        (out / "model.json").write_text(json.dumps(plain(model), indent=1), encoding="utf-8")


def _finish(document: Mapping[str, Any], out: Path | None, as_json: bool) -> None:
    import typer

    from commissioner.cli.screen import emit

    if as_json:
        emit(document)
    else:
        _show(document, out)
    if document["verdict"] == "refused":
        raise typer.Exit(3)


COLOURS = {"explained": "green", "nothing_significant": "green", "not_distinguishable": "yellow"}
MOST_LIMITS = 6


def _show(document: Mapping[str, Any], out: Path | None) -> None:
    """The short human view: sentence, error, causes, what would have been seen, what next."""
    from commissioner.cli.screen import out as screen
    from commissioner.report.diagnose_page import headline, in_words, next_sentence, number

    colour = COLOURS.get(document["verdict"], "red")
    screen.print(f"[bold {colour}]{_escaped(headline(document))}[/]")
    for sentence in in_words(document):
        screen.print(_escaped(sentence))
    gain = document["gain"]
    if gain["rmse_before_a"] is not None:
        before, after = (f"{number(gain[k] * 1e3)}" for k in ("rmse_before_a", "rmse_after_a"))
        change = f"{before} -> {after} mA" if document["causes"] else f"{before} mA"
        noise = f", noise {number(gain['noise_floor_a'] * 1e3)} mA" if gain["noise_floor_a"] else ""
        screen.print(f"error {change} rms on data left out{noise}")
    if document["causes"]:
        screen.print(_table_of_causes(document))
    elif document.get("detection_limit_sizes"):
        screen.print(f"would have been seen: {_limits(document)}")
    for sentence in (*document.get("remarks", ()), *document.get("audit", ())):
        screen.print(f"[dim]{_escaped(sentence)}[/]")
    if document["next_experiment"]:
        screen.print(f"next  {_escaped(next_sentence(document['next_experiment']))}")
    if out is not None:
        screen.print(f"[dim]report[/] {_escaped(str(out))}", soft_wrap=True)


def _escaped(text: str) -> str:
    from rich.markup import escape

    return escape(text)


def _table_of_causes(document: Mapping[str, Any]) -> Any:
    from commissioner.cli.screen import table
    from commissioner.report.diagnose_page import percent, quantity, sure

    def row(cause: Mapping[str, Any]) -> tuple[str, ...]:
        size = next((quantity(value, key) for key, value in cause["parameters"].items()), "")
        share = percent(cause["gain_share"]) if cause.get("found_by") != "audit" else "-"
        return cause["name"], size, share, sure(cause["confidence"]), ", ".join(n.replace("_", " ") for n in cause["equivalent"])

    rows = [row(cause) for cause in document["causes"]]
    header = ("cause", "size", "share", "name right", *(["or as well"] if any(r[-1] for r in rows) else []))
    return table("", header, [r[: len(header)] for r in rows], right=(2, 3))


def _limits(document: Mapping[str, Any]) -> str:
    """The detection limits of the commonest causes."""
    from commissioner.report.diagnose_page import limit_words

    common = ("dead_time", "leakage_saturation", "magnetizing_saturation", "rotor_skin_effect", "sampling_delay", "sensor_offset")
    known = [n for n in (*common, *document["detection_limit_sizes"]) if n in document["detection_limit_sizes"]]
    return ", ".join(f"{n} from {limit_words(document, n)}" for n in dict.fromkeys(known[:MOST_LIMITS]))
