"""`commissioner simulate MODEL`: play a motor, plain or extended by `diagnose`, into a recording."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from commissioner.cli.angles import parse_axes
from commissioner.errors import ConfigurationError, UsageError

if TYPE_CHECKING:
    from collections.abc import Callable

    from commissioner.diagnose.plant.model import Layout, Model

MAX_BYTES = 5_000_000
SAMPLE_PERIOD_S = 2e-4


def simulate(
    model: str,
    out: Path,
    like: Path | None = None,
    seconds: float = 6.0,
    axes: str = "0,60,120",
    noise_a: float = 0.0,
    seed: int = 1,
    plain: bool = False,
    as_json: bool = False,
) -> None:
    """Write the currents of `model` (a model.json of `diagnose`, or a motor's name or file) as a recording.

    The command is that of the recording `like`, or a six-tone multisine at two levels on `axes`. `plain` leaves the
    named effects out.
    """
    from commissioner.cli.screens.screen import busy, emit, err
    from commissioner.diagnose.export import playback as player
    from commissioner.recordings.table import check_ending, write_table

    check_ending(out)
    angles = parse_axes(axes) or ()
    _check_size(seconds, noise_a)
    made, layout, lines, plate = _model(model, plain)
    facts = _facts(plate)
    if like is None:
        plan = player.default_plan(angles)
        segments = player.command(made, facts, plan, seconds, seed)
    else:
        segments, facts = _command_of(like, facts)
    with busy("playing"):
        columns = _played(model, lambda: player.play(made, layout, facts, segments, lines, noise_a, seed))
    keys = {k: v for k, v in plate.items() if isinstance(v, int | float | str) and k not in ("name", "scenario")}
    write_table(out, columns, {**keys, "sample_period_s": facts.sample_period_s, "kind": "standstill"})
    summary = {
        "recording": str(out),
        "samples": int(columns["time_s"].shape[0]),
        "segments": len(segments),
        "effects": sorted({t.effect for t in made.terms if t.effect}),
    }
    if as_json:
        emit(summary)
    else:
        err.print(f"{summary['samples']} samples in {summary['segments']} segments written to {out}")


def _played(model: str, play: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """The columns; ConfigurationError where the model cannot be played or runs away."""
    import numpy as np

    try:
        with np.errstate(all="ignore"):
            columns = play()
    except (IndexError, np.linalg.LinAlgError) as error:
        raise ConfigurationError(
            file=model,
            key="terms",
            value=str(error),
            expected="numbers that its own dictionary has, as `commissioner diagnose` writes them",
        ) from error
    if not all(np.isfinite(values).all() for values in columns.values()):
        raise ConfigurationError(
            file=model, key="nominal and terms", value="currents that run away", expected="numbers of a motor"
        )
    return columns


def _check_size(seconds: float, noise_a: float) -> None:
    for name, value, low, high in (("--seconds", seconds, 0.1, 3600.0), ("--noise-a", noise_a, 0.0, 1e4)):
        if not low <= value <= high:
            raise UsageError(
                f"{name} {value:g} is out of range",
                step="command line",
                value=value,
                limit=f"{low:g} ... {high:g}",
                remedy=f"give {name} a value in this range",
            )


def _model(name: str, plain: bool) -> tuple[Model, Layout | None, dict[str, float], dict[str, Any]]:
    """(model, dictionary, line frequencies, nameplate)."""
    path = Path(name)
    if path.suffix == ".json":
        return _extended(path, plain)
    from dataclasses import asdict

    from commissioner.diagnose.plant.model import Model
    from commissioner.motor.nameplate import prior
    from commissioner.settings import load_motor

    plate = load_motor(name)
    typical = prior(plate).typical.as_tuple()
    return Model(typical), None, {}, {k: v for k, v in asdict(plate).items() if v is not None}


def _extended(path: Path, plain: bool) -> tuple[Model, Layout | None, dict[str, float], dict[str, Any]]:
    import json

    from commissioner.diagnose.export.model_file import model_from
    from commissioner.diagnose.export.model_file import plain as without_effects

    if not path.is_file():
        raise UsageError(
            f"there is no file {path}",
            step="read model",
            value=str(path),
            limit="an existing file",
            remedy="check the path",
        )
    if path.stat().st_size > MAX_BYTES:
        raise ConfigurationError(
            file=str(path), key="size", value=path.stat().st_size, expected=f"at most {MAX_BYTES} bytes"
        )
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        document = without_effects(document) if plain else document
        made, layout = model_from(document)
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise ConfigurationError(
            file=str(path), key="document", value=str(error), expected="a model.json written by `commissioner diagnose`"
        ) from error
    return made, layout, dict(document.get("lines_hz", {})), dict(document.get("nameplate", {}))


def _facts(plate: dict[str, Any]) -> Any:
    from math import pi, sqrt

    from commissioner.diagnose.intake.record import Facts

    current = sqrt(2.0) * float(plate.get("rated_current_a", 1.0))
    voltage, frequency = float(plate.get("rated_voltage_v", 0.0)), float(plate.get("rated_frequency_hz", 0.0))
    flux = sqrt(2.0 / 3.0) * voltage / (2.0 * pi * frequency) if frequency else 0.0
    period = float(plate.get("sample_period_s", SAMPLE_PERIOD_S))
    return Facts(period, current, float(plate.get("rated_power_w", 1.0)), flux, current, None, None, 3, plate)


def _command_of(path: Path, facts: Any) -> tuple[list[tuple[float, Any]], Any]:
    from dataclasses import replace

    from commissioner.diagnose.intake.audit import prepare
    from commissioner.recordings.table import read_table, to_standstill

    record, _ = prepare([to_standstill(read_table(path))])
    segments = [(s.axis_deg, s.voltage_axis_v) for s in record.segments]
    return segments, replace(facts, sample_period_s=record.facts.sample_period_s)
