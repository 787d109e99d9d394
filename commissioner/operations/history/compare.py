"""A run beside another one, beside recordings, beside what the drive holds: which parameter moved, how surely, and by what."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from commissioner.errors import DataRefused, UsageError
from commissioner.history.explain import Array, Explanation, explain
from commissioner.identify.estimate.axes import Combined, Comparison, compare, scatter
from commissioner.identify.estimate.common_ground import CommonGround, Result, brought_together
from commissioner.motor.circuit import PARAMETERS
from commissioner.operations.history.runs import Archive, find_runs
from commissioner.run.archive.catalogue import find_run
from commissioner.run.archive.summary import RunSummary
from commissioner.run.archive.verify import refuse_changed
from commissioner.run.index.results import flux_level, result_from, result_of


@dataclass(frozen=True)
class Compared:
    """`common`: the flux at which L_M and the temperature at which resistances were compared, and in words. `explained_by`: causes
    of which each alone would suffice, the most probable first. `motors`: whose the two are, as far as somebody said."""

    before: str
    after: str
    comparison: Comparison
    common: CommonGround
    explained_by: tuple[Explanation, ...] = ()
    motors: tuple[str, str] = ("", "")


@dataclass(frozen=True)
class HeldRow:
    """One parameter: of the run, and as the drive holds it, SI. `sigmas`: their difference in the run's standard errors."""

    parameter: str
    run: float
    std: float
    drive: float
    relative_change: float
    sigmas: float


@dataclass(frozen=True)
class SetBy:
    """Another run of the archive whose values the drive holds, and the peak stator flux that its L_M and T_R hold at."""

    run: str
    holds_for_stator_flux_wb: float | None


@dataclass(frozen=True)
class Held:
    """What the drive holds beside what a run identified. `holds`: the run's values | other values. `holds_for_stator_flux_wb`: of the
    run's L_M and T_R; of the drive's it is known only where another run set them, `set_by`."""

    run: str
    drive: str
    holds: str
    rows: tuple[HeldRow, ...]
    holds_for_stator_flux_wb: float | None = None
    set_by: SetBy | None = None


SAME_VALUE = 1e-5
"""Relative: a drive keeps single precision, or fewer digits; nearer values are the same one."""


def compare_runs(runs: Path, before: str, after: str) -> Compared:
    """UsageError: not two runs. DataRefused: one of them identified nothing."""
    first, second = _find(runs, before), _find(runs, after)
    if first.run == second.run:
        raise UsageError(
            "a run cannot be compared with itself", step="compare", value=first.run, limit="two runs",
            remedy=f"`commissioner runs list --runs {runs}` shows the ids",
        )  # fmt: skip
    done = beside(result_of(first), result_of(second))
    return replace(done, motors=(first.motor_id, second.motor_id))


def compare_with_recordings(runs: Path, run: str, files: tuple[Path, ...], motor: str | None = None) -> Compared:
    """A run beside what `identify` makes of recordings of the same motor, which come after it."""
    from commissioner.operations.recordings.identify import IdentifyRequest, identify

    first = _find(runs, run)
    before = result_of(first)
    document = identify(IdentifyRequest(files, motor)).document
    return replace(
        beside(before, result_from(document, ", ".join(file.name for file in files))), motors=(first.motor_id, "")
    )


def compare_with_drive(runs: Path, run: str, drive: str | None = None) -> Held:
    """Reads the drive, changes nothing. DataRefused: the drive holds none of the four in the contract's sense."""
    from commissioner.run.write_accepted import held_by_drive

    summary = _find(runs, run)
    result = result_of(summary)
    identity, held = held_by_drive(summary, drive)
    values = dict(zip(PARAMETERS, result.combined.parameters.as_tuple(), strict=True))
    std = dict(zip(PARAMETERS, np.sqrt(np.diag(result.combined.covariance)), strict=True))
    rows = tuple(
        HeldRow(name, values[name], float(std[name]), held[name], held[name] / values[name] - 1.0,
                float(abs(held[name] - values[name]) / std[name]) if std[name] > 0 else 0.0)
        for name in PARAMETERS
        if name in held
    )  # fmt: skip
    if not rows:
        raise DataRefused(
            "the drive holds none of the four parameters as they are named here", step="compare", value=identity,
            limit="an inverse-Gamma parameter in its file", remedy="`commissioner drives show` says what its file describes",
        )  # fmt: skip
    level = flux_level(summary.parameters)
    if all(abs(row.relative_change) < SAME_VALUE for row in rows):
        return Held(summary.run, identity, "the run's values", rows, level)
    return Held(summary.run, identity, "other values", rows, level, _set_by(runs, held))


def _find(runs: Path, run: str) -> RunSummary:
    """DataRefused: somebody changed its result, so that what moved would be the file and not the motor."""
    found = find_run(runs, run)
    refuse_changed(Path(found.folder), "compare", "result.json")
    return found


def _set_by(runs: Path, held: Mapping[str, float]) -> SetBy | None:
    """The newest run of the archive that identified what the drive holds."""
    ours = {name: value for name, value in held.items() if name in PARAMETERS}
    for row in find_runs(Archive(runs)).rows:
        found = json.loads(row.document)["parameters"]
        if all(name in found and abs(ours[name] / found[name]["value"] - 1.0) < SAME_VALUE for name in ours):
            return SetBy(row.run, flux_level(found))
    return None


def beside(first: Result, second: Result) -> Compared:
    """Two results on common ground."""
    old, new, common = brought_together(first, second)
    comparison = compare(old, new, (first.winding_degc is not None, second.winding_degc is not None))
    moved = _logs(new) - _logs(old), np.hypot(scatter(old, True), scatter(new, True))
    told = explain(first, second, moved, common, comparison.verdict)
    return Compared(first.name, second.name, comparison, common, told)


def _logs(combined: Combined) -> Array:
    return np.asarray(np.log(combined.parameters.as_tuple()))
