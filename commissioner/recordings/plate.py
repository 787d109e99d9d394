"""The nameplate of a running recording: a motor file, or the recording's own metadata; and a start from commissioning."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from commissioner.encoding import read_json
from commissioner.errors import ConfigurationError, UsageError
from commissioner.monitor.machine.fit import PRIOR_FROM_COMMISSIONING, Start
from commissioner.motor.circuit import PARAMETERS, InverseGamma
from commissioner.motor.nameplate import RATED_VALUES, Nameplate, check, connection_of
from commissioner.motor.running import equal_leakages
from commissioner.records import ReadingNote

MAX_RESULT_BYTES = 10_000_000
SAME_INERTIA = 0.05
"""Share by which two statements of one inertia may differ: load torque is known to no less."""


def plate_of(metadata: Mapping[str, float | str], source: str, motor: str | None) -> Nameplate:
    """The plate; `motor` (a name or a file) overrides the metadata, but for an inertia that it does not
    state. ConfigurationError names what is missing or wrong."""
    if motor is not None:
        from commissioner.settings import load_motor

        plate, said = load_motor(motor), _inertia_of(metadata)
        return plate if plate.inertia_kg_m2 is not None else replace(plate, inertia_kg_m2=said)
    for key in RATED_VALUES:
        if not isinstance(metadata.get(key), float):
            raise ConfigurationError(
                file=source,
                key=key,
                value=metadata.get(key),
                expected="a number in the recording's metadata, or --motor NAME_OR_FILE",
            )
    values = {key: float(metadata[key]) for key in RATED_VALUES}
    pairs = metadata.get("pole_pairs")
    estimate = round(60 * values["rated_frequency_hz"] / max(values["rated_speed_rpm"], 1.0) - 0.02)
    plate = Nameplate(
        **values,
        pole_pairs=int(pairs) if isinstance(pairs, float) else max(estimate, 1),
        connection=str(connection_of(metadata.get("connection", "star"))),
        inertia_kg_m2=_inertia_of(metadata),
    )
    for problem in check(plate):
        raise ConfigurationError(file=source, key=problem.key, value=problem.value, expected=problem.expected)
    return plate


def _inertia_of(metadata: Mapping[str, float | str]) -> float | None:
    inertia = metadata.get("inertia_kg_m2")
    return float(inertia) if isinstance(inertia, float) and inertia > 0 else None


def inertia_overruled(metadata: Mapping[str, float | str], plate: Nameplate) -> tuple[ReadingNote, ...]:
    """A note where `plate`, of a motor file, takes the place of another inertia that the recording states: the load torque is by it."""
    said, taken = _inertia_of(metadata), plate.inertia_kg_m2
    if said is None or taken is None or abs(said - taken) <= SAME_INERTIA * taken:
        return ()
    return (
        ReadingNote(
            "inertia_overruled",
            f"the recording states an inertia of {said:.3g} kg m2, the motor file {taken:.3g}, which is taken: where the load's is to be in "
            "it, give --inertia",
        ),
    )


def has_no_plate(metadata: Mapping[str, float | str]) -> bool:
    """Whether nothing of a plate is given; one that is given in part is an error that names what is missing."""
    return not any(key in metadata for key in RATED_VALUES)


def start_from(path: Path) -> Start:
    """What commissioning or `identify` found: its `parameters` as the start and the prior of the fit, as wide as they were uncertain."""
    if not path.is_file() or path.stat().st_size > MAX_RESULT_BYTES:
        raise UsageError(
            f"there is no result {path}",
            step="read start",
            value=str(path),
            limit="the result.json of a run",
            remedy="give the result.json of a commissioning run",
        )
    try:
        document = read_json(path.read_text("utf-8"))
        parameters, kind = document["parameters"], str(document.get("kind", "commissioning result"))
        values = [float(parameters[name]["value"]) for name in PARAMETERS]
        stds = [float(parameters[name].get("std") or 0.0) for name in PARAMETERS]
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ConfigurationError(
            file=str(path),
            key="parameters",
            value=str(error),
            expected="the four inverse-Gamma parameters of a run's result",
        ) from error
    if not all(np.isfinite(v) and v > 0 for v in values):
        raise ConfigurationError(file=str(path), key="parameters", value=str(values), expected="four numbers above 0")
    r_s, r_r, leakage, main = (std / value for std, value in zip(stds, values, strict=True))
    own = (r_s, r_r, main, leakage)
    log_std = tuple(max(a, min(b, 1.0)) for a, b in zip(PRIOR_FROM_COMMISSIONING, own, strict=True))
    circuit = equal_leakages(InverseGamma(*values))
    return Start(circuit, (log_std[0], log_std[1], log_std[2], log_std[3]), f"{kind} {path.name}")
