"""The study file: strict TOML in, the cases out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from commissioner.errors import ConfigurationError, UsageError
from commissioner.motor.nameplate import Nameplate
from commissioner.settings import TestAngle, is_plate, load_motor
from commissioner.validation import FileTable

MOST_CASES = 1_000_000


class Specification(FileTable):
    """`study FILE.toml`; keys and their meaning: contracts of the product, Campaigns."""

    kind: Literal["commission", "identify", "diagnose", "monitor"]
    runs: Annotated[int, Field(ge=1, le=MOST_CASES, description="number of commissionings, 1 ... 1e6")] = 1
    motors: Annotated[
        Annotated[list[str], Field(min_length=1)] | Literal["all"], Field(description='names or files, or "all"')
    ] = "all"
    spread: Annotated[float, Field(ge=0, le=0.5, description="relative variation of the machines, 0 ... 0.5")] = 0.0
    effects: Annotated[list[str] | Literal["none", "any"], Field(description='names, or "none" or "any"')] = "none"
    noise_a: Annotated[float, Field(ge=0, le=100, description="amperes rms, 0 ... 100")] | None = None
    links: Literal["memory", "tcp"] = "memory"
    faults: list[str] = Field(default=[])
    axes_deg: Annotated[list[TestAngle], Field(min_length=1, max_length=12)] | None = None
    seed: Annotated[int, Field(ge=0, lt=2**31)] = 1
    files: str = ""


@dataclass(frozen=True)
class Case:
    """One row to be: everything that decides it. `plate`: of a motor that the simulator does not know."""

    number: int
    seed: int
    kind: str
    motor: str
    spread: float
    effects: tuple[str, ...]
    noise_a: float | None
    links: str
    faults: tuple[str, ...]
    axes_deg: tuple[float, ...]
    file: str = ""
    plate: Nameplate | None = None


def cases_of(study: Specification, path: Path, motors: Sequence[str]) -> list[Case]:
    """In order; the same file gives the same cases. ConfigurationError: an unknown motor, or no file fits."""
    if study.kind != "commission":
        return _of_files(study, path)
    names = list(motors) if study.motors == "all" else [_beside(name, path, motors) for name in study.motors]
    if study.files:
        raise ConfigurationError(
            file=str(path), key="files", value=study.files, expected='kind = "identify", "diagnose" or "monitor": a commissioning reads no recording',
        )  # fmt: skip
    plates = {name: _plate(name, path, motors) for name in names}
    effects = (study.effects,) if isinstance(study.effects, str) else tuple(study.effects)
    seeds = np.random.default_rng(study.seed).integers(0, 2**31, study.runs)
    return [
        Case(
            number, int(seed), study.kind, names[number % len(names)], study.spread, effects, study.noise_a, study.links,
            tuple(study.faults), tuple(study.axes_deg or ()), plate=plates[names[number % len(names)]],
        )
        for number, seed in enumerate(seeds)
    ]  # fmt: skip


def _beside(name: str, path: Path, motors: Sequence[str]) -> str:
    """As named where it is known or a file here; else the file beside the study's, if there is one."""
    is_beside = name not in motors and not Path(name).is_file() and (path.parent / name).is_file()
    return str(path.parent / name) if is_beside else name


def _plate(name: str, path: Path, motors: Sequence[str]) -> Nameplate | None:
    """None for a motor of the simulator's, by name or as a scenario file."""
    if name in motors:
        return None
    try:
        return load_motor(name) if is_plate(name) else None
    except UsageError as error:
        raise ConfigurationError(
            file=str(path), key="motors", value=name, expected=f"a file, a name in config/motors, or one of: {', '.join(motors)}"
        ) from error  # fmt: skip


def _plate_of_all(motors: Sequence[str], path: Path) -> str:
    """The one plate that stands for every recording of a study, in place of what each says of its motor. UsageError: it is none."""
    if len(motors) > 1:
        raise ConfigurationError(
            file=str(path), key="motors", value=", ".join(motors), expected="one plate for all recordings; a study file for each motor",
        )  # fmt: skip
    motor = _beside(motors[0], path, ())
    load_motor(motor)
    return motor


def _of_files(study: Specification, path: Path) -> list[Case]:
    is_pattern = study.files and not Path(study.files).is_absolute()
    files = sorted(path.parent.glob(study.files)) if is_pattern else []
    if not files:
        raise ConfigurationError(
            file=str(path),
            key="files",
            value=study.files or None,
            expected="a pattern, relative to the study file, that fits recordings",
        )
    motor = "" if study.motors == "all" else _plate_of_all(study.motors, path)
    return [
        Case(number, study.seed, study.kind, motor, 0.0, (), None, "file", (), (), str(name))
        for number, name in enumerate(files)
    ]
