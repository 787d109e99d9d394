"""Two runs beside each other, and a motor over the years."""

from __future__ import annotations

from collections.abc import Mapping

from typing_extensions import TypedDict

from commissioner.identify.contract import Measured


class ChangeDocument(TypedDict):
    """Of one parameter; `sigmas`: in joint standard errors."""

    parameter: str
    relative_change: float | None
    sigmas: float | None


class ComparisonDocument(TypedDict):
    """`changes`: every parameter, the most significant first; `verdict` counts those beyond `limit_sigmas`."""

    verdict: str
    changes: list[ChangeDocument]
    limit_sigmas: float
    reason: str


class CommonGroundDocument(TypedDict):
    """Flux and winding temperature at which two results are compared; null: each as it was measured."""

    stator_flux_wb: float | None
    temperature_degc: float | None
    sentences: list[str]


class ExplanationDocument(TypedDict):
    """A cause that alone would suffice. `size`, `std`: relative, of what it moves; `rest_probability`: of what it leaves, by chance."""

    cause: str
    size: float | None
    std: float | None
    rest_probability: float | None
    sentence: str


class ComparedDocument(TypedDict):
    """Two runs, the earlier one first; `motors`: whose they are, as far as somebody said."""

    before: str
    after: str
    comparison: ComparisonDocument
    common: CommonGroundDocument
    explained_by: list[ExplanationDocument]
    motors: list[str]


class TrendPoint(TypedDict):
    """One accepted result; L_M holds at `flux_wb`, a peak stator flux."""

    run: str
    utc: str
    flux_wb: float | None
    parameters: Mapping[str, Measured]


class TrendChange(TypedDict):
    """From the first point to the last, as the two runs are compared: at one flux and temperature; `sigmas`: in what two tests of an
    unchanged motor differ by."""

    relative: float
    sigmas: float
    is_beyond_chance: bool


class LeftOut(TypedDict):
    run: str
    why: str


class TrendDocument(TypedDict):
    """Oldest first; `changes` by parameter, empty of fewer than two points and where the first and the last cannot be compared.
    `left_out`: runs that stand at no known time, each with why."""

    motor: str
    points: list[TrendPoint]
    changes: dict[str, TrendChange]
    left_out: list[LeftOut]
