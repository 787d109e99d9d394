"""A motor, plain or extended by a diagnosis, played into a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np

from commissioner.diagnose.export import playback
from commissioner.diagnose.export.model_file import model_from
from commissioner.diagnose.export.model_file import plain as without_effects
from commissioner.diagnose.intake.audit import prepare
from commissioner.diagnose.intake.record import Facts
from commissioner.diagnose.plant.model import Layout, Model
from commissioner.encoding import read_json
from commissioner.errors import ConfigurationError, UsageError
from commissioner.link.files.drive_file import known_drives, load_profile
from commissioner.motor.nameplate import prior
from commissioner.operations.events import Began, Observe, nobody
from commissioner.operations.ranges import require_range
from commissioner.operations.recordings import catalogue
from commissioner.operations.recordings.intake import standstill
from commissioner.operations.recordings.running import is_running_model, played
from commissioner.paths import MOTOR, no_file
from commissioner.recordings.catalogue.reading import sheet_of
from commissioner.recordings.importers import contract_table
from commissioner.recordings.table import check_ending, write_table
from commissioner.settings import load_motor, read_toml

MAX_BYTES = 5_000_000
WITHOUT_NOISE = (
    "it holds no noise, as no sensor's recording does: `identify` will call its residual not white, for a solver's error is left over; "
    "--noise-a gives the currents some, in A rms"
)
SAMPLE_PERIOD_S = 2e-4
Command = list[tuple[float, Any]]
"""Axis in degrees and voltage along it, a segment each."""


@dataclass(frozen=True)
class SimulateRequest:
    """`model`: a model.json of a diagnosis, a manufacturer's sheet, or the name or file of a motor or of a drive with a test mode. The command is that of the recording `like`, or six tones
    at two levels on `axes_deg` for `seconds` each. `plain` leaves the named effects out."""

    model: str
    out: Path
    like: Path | None = None
    seconds: float = 6.0
    axes_deg: tuple[float, ...] = (0.0, 60.0, 120.0)
    noise_a: float = 0.0
    seed: int = 1
    plain: bool = False


@dataclass(frozen=True)
class Simulated:
    """The recording that was written, and the effects in it."""

    recording: str
    samples: int
    segments: int
    effects: tuple[str, ...]
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Motor:
    """A model, its dictionary, its line frequencies, its plate."""

    model: Model
    layout: Layout | None
    lines_hz: Mapping[str, float]
    plate: Mapping[str, Any]


def simulate(request: SimulateRequest, observe: Observe = nobody) -> Simulated:
    """Writes the recording. ConfigurationError where the model cannot be played or runs away."""
    check_ending(request.out)
    for option, value, low, high in (
        ("--seconds", request.seconds, 0.1, 3600.0),
        ("--noise-a", request.noise_a, 0.0, 1e4),
        ("--seed", request.seed, 0, 2**63 - 1),
    ):
        require_range(option, value, low, high)
    running = _running_model(request.model)
    if running is not None:
        observe(Began("playing"))
        samples, names = played(
            running, request.model, request.out, request.like, request.noise_a, request.seed, is_plain=request.plain
        )
        return Simulated(str(request.out), samples, 1, names, _remarks(request))
    motor = _motor(request.model, request.plain)
    facts = _facts(motor.plate)
    said: list[str] = []
    if request.like is None:
        plan = playback.default_plan(request.axes_deg)
        segments = playback.command(motor.model, facts, plan, request.seconds, request.seed)
    else:
        segments, facts, said = _command_of(request.like, facts)
    observe(Began("playing"))
    columns = _played(
        request.model,
        lambda: playback.play(
            motor.model, motor.layout, facts, segments, dict(motor.lines_hz), request.noise_a, request.seed
        ),
    )
    keys = {k: v for k, v in motor.plate.items() if isinstance(v, int | float | str) and k not in ("name", "scenario")}
    write_table(request.out, columns, {**keys, "sample_period_s": facts.sample_period_s, "kind": "standstill"})
    effects = tuple(sorted({t.effect for t in motor.model.terms if t.effect}))
    return Simulated(
        str(request.out), int(columns["time_s"].shape[0]), len(segments), effects, (*said, *_remarks(request))
    )


def _remarks(request: SimulateRequest) -> tuple[str, ...]:
    """What whoever reads the recording has to know of it."""
    return (WITHOUT_NOISE,) if request.noise_a == 0.0 else ()


def _running_model(name: str) -> Mapping[str, Any] | None:
    """The document of a running diagnosis' model; None for everything else."""
    path = Path(name)
    if path.suffix != ".json" or not path.is_file() or path.stat().st_size > MAX_BYTES:
        return None
    try:
        document = read_json(path.read_text("utf-8"))
    except ValueError:
        return None
    return document if isinstance(document, dict) and is_running_model(document) else None


def _played(name: str, play: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """The columns; ConfigurationError where the model cannot be played or runs away."""
    try:
        with np.errstate(all="ignore"):
            columns = play()
    except (IndexError, np.linalg.LinAlgError) as error:
        raise ConfigurationError(
            file=name,
            key="terms",
            value=str(error),
            expected="numbers that its own dictionary has, as `commissioner diagnose` writes them",
        ) from error
    if not all(np.isfinite(values).all() for values in columns.values()):
        raise ConfigurationError(
            file=name, key="nominal and terms", value="currents that run away", expected="numbers of a motor"
        )
    return columns


def _motor(name: str, plain: bool) -> _Motor:
    path = Path(name)
    if path.suffix == ".json":
        return _extended(path, plain)
    if (sheet := sheet_of([path], None)) is not None:
        return _of_document(catalogue.model_document(catalogue.answered(sheet, None, None)))
    plate = load_motor(_motor_at(name))
    typical = prior(plate).typical.as_tuple()
    return _Motor(Model(typical), None, {}, plate.known())


def _motor_at(name: str) -> str:
    """The motor of this name or file; of a drive's file, which describes none, the one that comes along. UsageError: the drive has
    no test mode, so there is no recording of it."""
    is_drive = "drive" in read_toml(Path(name)) if name.endswith(".toml") else name in known_drives()
    if not is_drive:
        return name
    if "excite" not in load_profile(name).capabilities:
        raise UsageError(
            f"{name} applies no test voltage", step="simulate", value=name, limit="a drive with the capability `excite`, or a motor",
            remedy="give the motor's name or file",
        )  # fmt: skip
    return MOTOR


def _extended(path: Path, plain: bool) -> _Motor:
    if not path.is_file():
        raise no_file(path, "read model")
    if path.stat().st_size > MAX_BYTES:
        raise ConfigurationError(
            file=str(path), key="size", value=path.stat().st_size, expected=f"at most {MAX_BYTES} bytes"
        )
    try:
        document = read_json(path.read_text("utf-8"))
        return _of_document(without_effects(document) if plain else document)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise UsageError(
            f"{path} holds no model", step="simulate", value=str(error), limit="a model.json written by `commissioner diagnose`",
            remedy="give the model.json of a diagnosis, or a motor's name or file",
        ) from error  # fmt: skip


def _of_document(document: Mapping[str, Any]) -> _Motor:
    """KeyError, TypeError or ValueError where it is no model."""
    model, layout = model_from(document)
    return _Motor(model, layout, dict(document.get("lines_hz", {})), dict(document.get("nameplate", {})))


def _facts(plate: Mapping[str, Any]) -> Facts:
    current = sqrt(2.0) * float(plate.get("rated_current_a", 1.0))
    voltage, frequency = float(plate.get("rated_voltage_v", 0.0)), float(plate.get("rated_frequency_hz", 0.0))
    flux = sqrt(2.0 / 3.0) * voltage / (2.0 * pi * frequency) if frequency else 0.0
    period = float(plate.get("sample_period_s", SAMPLE_PERIOD_S))
    power = float(plate.get("rated_power_w", 1.0))
    return Facts(period, current, power, flux, current, None, None, 3, dict(plate))


def _command_of(path: Path, facts: Facts) -> tuple[Command, Facts, list[str]]:
    """The command of a recording of any form that `identify` reads, at its rate, and what its reader says."""
    recordings, said = standstill([contract_table(path)], None)
    record, _ = prepare(recordings)
    segments: Command = [(s.axis_deg, s.voltage_axis_v) for s in record.segments]
    return segments, replace(facts, sample_period_s=record.facts.sample_period_s), said
