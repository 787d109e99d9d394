"""How a plate was judged, and how the page says so."""

from __future__ import annotations

from typing import NotRequired

from typing_extensions import TypedDict


class JudgedField(TypedDict):
    """`what` is wrong and the `remedy`; both empty where it is ok."""

    ok: bool
    what: str
    remedy: str


class JudgedPlate(TypedDict):
    """`efficiency` at rated load as a fraction, the lowest and highest that is usual at this power, and `slip` as a fraction: null or
    missing where a field is not ok yet."""

    ok: bool
    fields: dict[str, JudgedField]
    efficiency: float | None
    usual_efficiency: tuple[float, float] | None
    questions: list[str]
    slip: NotRequired[float]


class SaidPlate(TypedDict):
    """The same in words, for the page: `fields` each with its fault, `is_odd`: the plate should be asked about."""

    ok: bool
    fields: dict[str, str]
    verdict: str
    reason: str
    is_odd: bool
