"""How a motor, or a watched machine, does over the years."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from commissioner.errors import DataRefused, UsageError
from commissioner.history.motor import Trends, indicator_trends, motor_trends
from commissioner.monitor.trend.trend import is_same_point
from commissioner.operations.history.motors import runs_of
from commissioner.operations.history.runs import Archive
from commissioner.recordings.baseline import read
from commissioner.records import in_words
from commissioner.run.archive.catalogue import DATED_AHEAD, is_ahead, read_run
from commissioner.run.archive.verify import changed
from commissioner.run.index.results import has_result
from commissioner.run.index.years import measured_in, seconds

PICTURES = (".svg", ".png")


@dataclass(frozen=True)
class MotorTrend:
    """`left_out`: runs or recordings that say nothing here, each with why. `picture`: where it was written."""

    motor: str
    found: Trends
    left_out: tuple[str, ...]
    picture: str | None


def trend(archive: Archive, motor: str, picture: Path | None = None) -> MotorTrend:
    """Of every run of the motor that identified it. UsageError: no such motor. DataRefused: none of them did."""
    _check(picture)
    measured, left_out = [], []
    for row in reversed(runs_of(archive, motor)):
        summary = read_run(Path(row.folder))
        if changed(Path(row.folder), "result.json"):
            left_out.append(f"{row.run}: result.json is not as the run left it")
        elif is_ahead(summary.started_utc):
            left_out.append(f"{row.run}: {DATED_AHEAD}")
        elif has_result(summary):
            measured.append(measured_in(summary))
        else:
            left_out.append(f"{row.run}: {summary.standing}, without parameters")
    if not measured:
        raise DataRefused(
            f"no run of {motor} identified it", step="trend", value=f"{len(left_out)} runs without parameters", limit="one with them",
            remedy="`commissioner runs list` shows how they ended",
        )  # fmt: skip
    found = motor_trends(measured)
    return MotorTrend(motor, found, tuple(left_out), _draw(motor, found, picture))


def trend_of_indicators(baseline: Path, picture: Path | None = None) -> MotorTrend:
    """Of every recording that `monitor --baseline` kept, at the newest one's operating point, in the order they were kept; what a clock
    that was ahead has dated is not the newest, and left out. DataRefused: there is none."""
    _check(picture)
    history = read(baseline)
    kept = (*history.healthy, *history.judged)
    entries = sorted((entry for entry in kept if not is_ahead(entry.utc)), key=lambda entry: entry.utc)
    if kept and not entries:
        raise DataRefused(
            f"every recording in {baseline} is dated in the future", step="trend", value=min(entry.utc for entry in kept),
            limit="a time that has come", remedy="set this computer's clock",
        )  # fmt: skip
    if not entries:
        raise DataRefused(
            f"{baseline} holds no recording", step="trend", value=0, limit="at least one",
            remedy="`commissioner monitor FILE --baseline` adds one",
        )  # fmt: skip
    newest = entries[-1]
    alike = [entry for entry in entries if is_same_point(entry, newest)]
    left_out = (
        *(f"{entry.source}: at another operating point" for entry in entries if entry not in alike),
        *(f"{entry.source}: {DATED_AHEAD}" for entry in kept if is_ahead(entry.utc)),
    )
    names = [name for name in newest.indicators if all(name in entry.indicators for entry in alike)]
    series = {
        name: [
            (entry.source, seconds(entry.utc) if entry.utc else float(k), *entry.indicators[name])
            for k, entry in enumerate(alike)
        ]
        for name in names
    }
    found = indicator_trends(series, {name: in_words(name)[1] for name in names})
    return MotorTrend(baseline.stem, found, left_out, _draw(baseline.stem, found, picture))


def _draw(title: str, found: Trends, picture: Path | None) -> str | None:
    if picture is None:
        return None
    from commissioner.report.history.figures import over_years

    picture.parent.mkdir(parents=True, exist_ok=True)
    over_years(title, found).savefig(picture, metadata={"Date": None} if picture.suffix == ".svg" else None)
    return str(picture)


def _check(picture: Path | None) -> None:
    if picture is not None and picture.suffix not in PICTURES:
        raise UsageError(
            "the picture's format is not known", step="trend", value=picture.name, limit=" or ".join(PICTURES),
            remedy="give --out a name that ends so",
        )  # fmt: skip
