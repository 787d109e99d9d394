"""The JSON of a diagnosis, as promised: names, shapes, units. What `document` builds and the shipped schemas say."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NotRequired

from typing_extensions import TypedDict


class Measured(TypedDict):
    """A value and one standard deviation, in SI units. Of L_M and T_R `at_stator_flux_wb` is the peak stator flux at which they
    hold; null: one value for all flux levels of the data."""

    value: float | None
    std: float | None
    at_stator_flux_wb: NotRequired[float | None]


class Size(TypedDict):
    """How large a cause is."""

    value: float | None
    std: float | None
    unit: str


class CauseDocument(TypedDict):
    """`equivalent`: names that fit as well."""

    name: str
    title: NotRequired[str]
    parameters: dict[str, Size]
    gain_share: float
    confidence: float
    equivalent: list[str]
    strength_over_noise: NotRequired[float | None]
    delta_chi2: NotRequired[float | None]
    alternatives: NotRequired[dict[str, float]]
    found_by: NotRequired[str]
    p_value: NotRequired[float | None]


class Gain(TypedDict):
    """What the causes gain on data that were kept aside."""

    held_out: float | None
    rmse_before_a: float | None
    rmse_after_a: float | None
    noise_floor_a: float | None
    explained_share: NotRequired[float | None]
    structured_error_over_noise: NotRequired[float | None]
    relative_error_before: NotRequired[float | None]
    relative_error_after: NotRequired[float | None]


class NoiseDocument(TypedDict):
    """Of each current."""

    source: str
    is_known: bool
    is_white: bool
    sigma_a: list[float]


class UncertainName(TypedDict):
    """A cause that was seen, or could hide behind a named one."""

    name: str
    why: str
    decides: str
    is_seen: bool


class DiagnosisDocument(TypedDict):
    """Of recordings (`kind` recording) or of a table of test points (`points`); of several tables each one under `tables`.

    `search`: every record of the search (`search.journal`), from which its choices follow again.
    """

    verdict: str
    reason: str
    error: NotRequired[dict[str, Any]]
    kind: str
    test: NotRequired[str]
    convention: str
    causes: list[CauseDocument]
    gain: Gain
    noise: NotRequired[NoiseDocument | None]
    parameters_before: dict[str, Measured]
    parameters_after: dict[str, Measured]
    below_materiality: NotRequired[list[str]]
    detection_limits: NotRequired[Mapping[str, Any]]
    cannot_tell: NotRequired[list[str]]
    line_levels_db: NotRequired[dict[str, float | None]]
    audit: NotRequired[list[str]]
    remarks: NotRequired[list[str]]
    is_complete: NotRequired[bool]
    tested_p_values: NotRequired[dict[str, float | None]]
    points: NotRequired[list[dict[str, float | None]]]
    uncertain: NotRequired[list[UncertainName]]
    dc_link_v: NotRequired[float | None]
    search: NotRequired[list[dict[str, Any]]]
    next_experiment: dict[str, Any] | None
    model_file: str | None
    tables: NotRequired[dict[str, DiagnosisDocument]]
