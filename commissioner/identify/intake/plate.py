"""The nameplate as it stands in a recording's metadata."""

from __future__ import annotations

from collections.abc import Mapping

from commissioner.errors import ConfigurationError, DataRefused
from commissioner.motor.nameplate import RATED_VALUES, Nameplate, check, connection_of

NAMEPLATE_KEYS = (*RATED_VALUES, "pole_pairs")


def nameplate_from(metadata: Mapping[str, float | str], source: str = "the recording") -> Nameplate:
    """The nameplate in a recording's metadata; DataRefused naming the first key that is missing, ConfigurationError the first
    that is impossible."""
    for key in NAMEPLATE_KEYS:
        if not isinstance(metadata.get(key), float | int):
            raise DataRefused(
                f"the recording's metadata lack {key}",
                step="read the nameplate",
                value=metadata.get(key),
                limit="a number in SI units",
                remedy=f"add '# {key}: ...' to the file, or give --motor",
            )
    number = {key: float(metadata[key]) for key in NAMEPLATE_KEYS}
    pole_pairs = int(number.pop("pole_pairs"))
    inertia = metadata.get("inertia_kg_m2")
    plate = Nameplate(
        **number,
        pole_pairs=pole_pairs,
        connection=str(connection_of(metadata.get("connection", "star"))),
        inertia_kg_m2=float(inertia) if isinstance(inertia, float | int) else None,
    )
    for problem in check(plate):
        raise ConfigurationError(file=source, key=problem.key, value=problem.value, expected=problem.expected)
    return plate
