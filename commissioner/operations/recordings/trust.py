"""Plate and data that contradict each other: named with both values, and which of the two the user says is right."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Literal, cast

from commissioner.errors import DataRefused, UsageError
from commissioner.motor.circuit import InverseGamma, Quantity
from commissioner.motor.nameplate import Nameplate, plate_doubts
from commissioner.motor.plate_match import Contradiction, OperatingPoint, contradiction, doubt, rated_point
from commissioner.records import Signal, StandstillRecording

Trust = Literal["plate", "data"]
TOLD = 0.1
"""Relative standard error of each of the four up to which a running motor's are compared with its plate."""


def trust_from(said: str | None) -> Trust | None:
    """UsageError for another word."""
    if said not in (None, "plate", "data"):
        raise UsageError(
            f"there is no trust in {said!r}", step="command line", value=said, limit="--trust plate or --trust data",
            remedy="say which of the two is right where they contradict each other",
        )  # fmt: skip
    return cast("Trust | None", said)


def refused(found: Contradiction) -> DataRefused:
    """The error of a contradiction that nobody has decided."""
    return DataRefused(
        found.what, step="compare data and plate", value=found.value, limit=found.limit, remedy=found.remedy
    )


def trusted_data(found: Contradiction) -> str:
    """What a result says whose user trusts the data."""
    return f"{found.what} ({found.value}): the data were trusted, as told"


def judged(circuit: InverseGamma, plate: Nameplate, trust: Trust | None) -> list[str]:
    """What the circuit says against the plate; DataRefused where they contradict each other, unless the data are to be trusted."""
    rated = rated_point(circuit, plate)
    against, said = contradiction(rated, plate), doubts(rated, plate)
    if against is None:
        return said
    if trust != "data":
        raise refused(against)
    return [trusted_data(against)]


def doubts(rated: OperatingPoint, plate: Nameplate) -> list[str]:
    """What is unusual about the plate itself, and beside what a circuit draws at its rated point; a sentence each."""
    return [said for said in (*plate_doubts(plate), doubt(rated, plate)) if said]


def unlike_plate(values: Mapping[str, Quantity], plate: Nameplate) -> list[str]:
    """What a running motor's four parameters say against the plate, a sentence each, where the recording tells all of them."""
    names = [one.name for one in fields(InverseGamma)]
    four = [values[name] for name in names if name in values]
    if len(four) < len(names) or not all(q.std < TOLD * q.value for q in four):
        return list(plate_doubts(plate))
    rated = rated_point(InverseGamma(*(q.value for q in four)), plate)
    against = contradiction(rated, plate)
    if against is None:
        return doubts(rated, plate)
    return [
        f"{against.what} ({against.value}; {against.limit}): check the scales of currents and voltages, whether the voltages are those between "
        "lines, and that the plate is this motor's, in its connection"
    ]


def trusted_plate(factor: float) -> str:
    """What a result says whose currents were brought to the plate."""
    return f"plate and data contradicted each other: the currents were divided by {factor:.4g}, as the plate was to be trusted"


def with_currents_over(recording: StandstillRecording, factor: float) -> StandstillRecording:
    """The recording with all currents divided by a factor."""

    def part(current: Signal | None) -> Signal | None:
        return None if current is None else current / factor

    return replace(
        recording,
        current_u_a=recording.current_u_a / factor,
        current_v_a=recording.current_v_a / factor,
        current_w_a=part(recording.current_w_a),
    )
