"""The online observer run over recorded stretches, as a live run would have fed it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from commissioner.identify.intake.stretches import Stretch
from commissioner.identify.inverter.compensation import Compensation
from commissioner.identify.observer.coordinates import PRIOR_LOG_STD
from commissioner.identify.observer.observer import BlockEstimate, ParallelObserver, StoredBlock
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import Nameplate, ParameterBox
from commissioner.motor.standstill import poles_per_s
from commissioner.records import Signal, peak

Matrix = NDArray[np.float64]
FINAL_REVIEWS = 6
UNKNOWN_STATE_LOG_STD = 0.03
"""How well parameters must be known before an unknown initial state is estimated beside them."""
BLOCK = 500
EXCITED, EXCITED_WINDOW_S = 0.3, 0.2


@dataclass(frozen=True)
class Observed:
    residuals: tuple[Signal, ...]
    residual_rms_a: float
    peak_rotor_flux_wb: float
    std: Matrix


def observe(
    stretches: Sequence[Stretch],
    plate: Nameplate,
    box: ParameterBox,
    period_s: float,
    compensation: Compensation,
    law: Literal["fast", "lyapunov"],
    start: InverseGamma | None,
) -> tuple[InverseGamma, Observed]:
    """The online observer over all stretches in turn; segments are holes of unknown length to it."""
    observer = ParallelObserver(
        box,
        period_s,
        plate.rated_current_peak_a,
        law=law,
        start=start,
        compensation=compensation,
        starts_at_rest=stretches[0].starts_at_rest,
        start_log_std=PRIOR_LOG_STD if stretches[0].starts_at_rest or start is None else UNKNOWN_STATE_LOG_STD,
        expected_voltage_v=np.concatenate([s.voltage_v for s in stretches]) if law == "lyapunov" else None,
    )
    average = _Average(sum(s.voltage_v.size for s in stretches))
    for k, stretch in enumerate(stretches):
        lost = stretch.lost_before if stretch.lost_before or stretch.starts_at_rest or not k else 1
        at_rest = stretch.starts_at_rest
        for a in range(0, stretch.voltage_v.size, BLOCK if law == "lyapunov" else stretch.voltage_v.size):
            part = slice(a, a + BLOCK if law == "lyapunov" else None)
            block = observer.advance(stretch.voltage_v[part], stretch.seen_a[part], lost, begins_at_rest=at_rest)
            average.add(block)
            lost, at_rest = 0, False
    if law == "fast":
        _review_until_still(observer)
    signals = observer.predicted(None if law == "fast" else average.parameters)
    shortest = min(s.voltage_v.size for s in stretches)
    settle = min(round(4.0 / -poles_per_s(observer.parameters)[0] / period_s), shortest // 3)
    residuals = tuple(_settled_residuals(observer.history, [current for current, _, _ in signals], settle))
    rotor = max(peak(flux) for _, flux, _ in signals)
    rms = math.sqrt(sum(float(r @ r) for r in residuals) / sum(r.size for r in residuals))
    parameters = observer.parameters if law == "fast" else average.parameters
    std = np.array(observer.std()) if law == "fast" else np.zeros(4)
    return parameters, Observed(residuals, rms, rotor, std)


def excited_part(stretch: Stretch, period_s: float) -> Stretch:
    """The stretch from where its current first stays above `EXCITED` of its largest.

    While a test begins at small amplitude the inverter's dead band takes most of the command: what is left tells the
    recursion about the band's shape, not about the motor.
    """
    size = np.abs(stretch.current_a)
    window = max(1, round(EXCITED_WINDOW_S / period_s))
    peaks = [float(np.max(size[a : a + window])) for a in range(0, size.size, window)]
    first = window * next(k for k, top in enumerate(peaks) if top >= EXCITED * max(peaks))
    if first == 0:
        return stretch
    return replace(
        stretch,
        voltage_v=stretch.voltage_v[first:],
        current_a=stretch.current_a[first:],
        cross_a=stretch.cross_a[first:],
        is_measured=None if stretch.is_measured is None else stretch.is_measured[first:],
        starts_at_rest=False,
        start_s=stretch.start_s + first * period_s,
    )


def _settled_residuals(pieces: Sequence[StoredBlock], predicted: Sequence[Signal], settle: int) -> Iterator[Signal]:
    """What is left of each piece, without the first `settle` samples after a state that was not known."""
    unsettled = 0
    for piece, current in zip(pieces, predicted, strict=True):
        unsettled = settle if piece.restarts else unsettled
        residual = (piece.current_a - current)[unsettled:]
        residual = residual[np.isfinite(residual)]
        unsettled = max(0, unsettled - current.size)
        if residual.size:
            yield residual


class _Average:
    """The seed's result of the gradient law: the mean of its estimates over the last sixth of the run (150-180 s of
    180)."""

    def __init__(self, total: int) -> None:
        self._from = total * 5 // 6
        self._sum, self._count = np.zeros(4), 0

    def add(self, block: BlockEstimate) -> None:
        if block.samples >= self._from:
            self._sum += block.parameters.as_tuple()
            self._count += 1

    @property
    def parameters(self) -> InverseGamma:
        a, b, c, d = map(float, self._sum / self._count)
        return InverseGamma(a, b, c, d)


def _review_until_still(observer: ParallelObserver) -> None:
    """Nothing more will come: go over the data until the estimate moves by less than a twentieth of its errors."""
    for _ in range(FINAL_REVIEWS):
        before = np.array(observer.parameters.as_tuple())
        observer.review()
        if np.all(np.abs(np.array(observer.parameters.as_tuple()) - before) < 0.05 * np.array(observer.std())):
            return
