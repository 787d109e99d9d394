"""What a page shows of a run that goes on."""

from __future__ import annotations

from typing_extensions import TypedDict


class LiveTest(TypedDict):
    """One test of the plan. `parameters`, `std`: R_s, R_R, L_sigma, L_M in SI, as far as known."""

    axis_deg: float
    state: str
    energised_s: float
    parameters: list[float] | None
    std: list[float] | None


class LiveCurrent(TypedDict):
    """Along the axis."""

    now_a: float
    high_a: float
    limit_a: float | None


class LiveFlux(TypedDict):
    """Of the stator."""

    now_wb: float | None
    high_wb: float | None
    limit_wb: float | None


class LiveTuning(TypedDict):
    """A drive's own tuning: how many are done, number of the question that waits for an answer."""

    done: int
    question: int | None


class LiveDocument(TypedDict):
    """The newest numbers of a run that goes on. `output`: on | off | unknown, by the drive's own word; `test`: number of the one that is
    running; `estimate`: time in s, four values, four standard errors of it, SI."""

    run: str
    phase: str
    output: str
    part: str
    test: int | None
    tests: list[LiveTest]
    planned_s: float
    left_s: float
    current: LiveCurrent
    flux: LiveFlux
    tuning: LiveTuning | None
    estimate: list[float] | None
    utc: str


class SamplesEvent(TypedDict):
    """Currents along the axis, least and largest in each `bin_s`; `t_s` runs on over all segments. `blocks`: of the archive, as far as
    they are in it."""

    segment: int
    axis_deg: float
    bin_s: float
    is_new: bool
    t_s: list[float]
    low_a: list[float]
    high_a: list[float]
    blocks: int
