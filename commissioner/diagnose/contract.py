"""The JSON of a diagnosis, as promised: names, shapes, units. What `document` builds and the shipped schemas say."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NotRequired, TypeAlias

from typing_extensions import TypedDict

from commissioner.encoding import Json
from commissioner.errors import ErrorDocument
from commissioner.identify.contract import SheetValue, Silence, StatedValue
from commissioner.motor.nameplate import Plate
from commissioner.records import DiagnosisVerdict

CONVENTION = "SI, per-phase star equivalent, referred to the stator; std is one standard deviation"


class Measured(TypedDict):
    """A value and one standard deviation, in SI units. Of L_M and T_R, of a running motor of R_R and L_sigma too, `at_stator_flux_wb` is the
    peak stator flux at which they hold; null: one value for all flux levels of the data."""

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
    form: NotRequired[str]
    is_of_measurement: NotRequired[bool]


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


class Limit(TypedDict):
    """The smallest size of a cause that the data would have shown; `of`: which of its sizes, where the name above does not say it."""

    value: float
    unit: str
    of: NotRequired[str]


class NextExperiment(TypedDict):
    """The test that tells apart what `splits` names: `steps` for a person, `command` for afterwards."""

    splits: list[str]
    do: str
    predicted_sigma: NotRequired[float | None]
    steps: list[str]
    command: str
    repeats: int
    changes_values: NotRequired[str]


SearchRecord: TypeAlias = dict[str, Json]
"""One record of the search: `step` names its kind, and that one's fields (`search.journal`) are beside."""


class NothingRecorded(TypedDict):
    """Of data that were refused."""


class Excitation(TypedDict):
    """What a running recording has that separates causes: seconds of each state, what was measured."""

    seconds: dict[str, float]
    has_speed: bool
    has_three_currents: bool
    has_start: bool


class ShaftLineTold(TypedDict):
    """A line that turns with the shaft, so many times a turn; both side bands, over the noise, root mean square."""

    per_turn: int
    over_noise: float


class DiagnosisDocument(TypedDict):
    """Of recordings (`kind` recording; `test` running where the motor ran) or of a table of test points (`points`); of several tables
    each one under `tables`.

    `search`: every record of the search, from which its choices follow again. From `method` on: of test sheets and of a
    manufacturer's sheet, as in the identification of one.
    """

    verdict: DiagnosisVerdict
    reason: str
    error: NotRequired[ErrorDocument]
    kind: str
    test: NotRequired[str]
    convention: str
    causes: list[CauseDocument]
    gain: Gain
    noise: NotRequired[NoiseDocument | None]
    parameters_before: dict[str, Measured]
    parameters_after: Mapping[str, Measured | StatedValue]
    below_materiality: NotRequired[list[str]]
    detection_limits: NotRequired[Mapping[str, Limit | dict[str, Limit]]]
    cannot_tell: NotRequired[list[str]]
    line_levels_db: NotRequired[dict[str, float | None]]
    audit: NotRequired[list[str]]
    remarks: NotRequired[list[str]]
    is_complete: NotRequired[bool]
    tested_p_values: NotRequired[dict[str, float | None]]
    points: NotRequired[list[dict[str, float | None]]]
    uncertain: NotRequired[list[UncertainName]]
    dc_link_v: NotRequired[float | None]
    search: NotRequired[list[SearchRecord]]
    left_by_state_over_noise: NotRequired[dict[str, float | None]]
    shaft_lines: NotRequired[list[ShaftLineTold]]
    excitation: NotRequired[Excitation | NothingRecorded]
    next_experiment: NextExperiment | None
    model_file: str | None
    tables: NotRequired[dict[str, DiagnosisDocument]]
    method: NotRequired[str]
    t_circuit: NotRequired[Mapping[str, float | StatedValue]]
    textbook: NotRequired[dict[str, float]]
    at_terminals: NotRequired[dict[str, float]]
    losses: NotRequired[Mapping[str, float | StatedValue | None]]
    holds_for_stator_flux_wb: NotRequired[float]
    withheld: NotRequired[dict[str, str]]
    double_cage: NotRequired[dict[str, StatedValue]]
    values: NotRequired[list[SheetValue]]
    assumed: NotRequired[tuple[Silence, ...]]
    nameplate: NotRequired[Plate | None]
