"""What a longer test would buy: noise falls with the square root of the time, everything else stays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from commissioner.identify.excite.tones import DesignedExcitation
from commissioner.motor.circuit import PARAMETERS, QUANTILE, SYMBOLS, InverseGamma

TIMES = 2.0


@dataclass(frozen=True)
class LongerTest:
    """Relative standard errors of (R_s, R_R, L_sigma, L_M) now and after tests of `seconds` each."""

    seconds: float
    now: tuple[float, ...]
    then: tuple[float, ...]

    @property
    def in_vain_for(self) -> frozenset[str]:
        """Names of those that it would not make surer by a twentieth."""
        return frozenset(name for name, a, b in zip(PARAMETERS, self.now, self.then, strict=True) if not b < 0.95 * a)

    @property
    def sentence(self) -> str:
        """For the technician; says so where time would not help."""
        gains = [
            f"{name} {100 * QUANTILE * a:.2g} -> {100 * QUANTILE * b:.2g} %"
            for key, name, a, b in zip(PARAMETERS, SYMBOLS, self.now, self.then, strict=True)
            if key not in self.in_vain_for
        ]
        if not gains:
            return (
                f"a longer test would buy nothing: {self.seconds:.3g} s of tones on each axis instead of "
                f"{self.seconds / TIMES:.3g} s leave the same 95 % intervals"
            )
        return f"{self.seconds:.3g} s of tones on each axis would narrow the 95 % intervals (±): " + ", ".join(gains)


def longer_test(
    parameters: InverseGamma,
    std: Sequence[float],
    tests: Sequence[DesignedExcitation],
    noise_a: Sequence[float],
) -> LongerTest:
    """Tests of `TIMES` the length: s^2 -> s^2 - n^2 + n^2 / TIMES.

    s: standard errors now; n: what sensor noise `noise_a` (rms, one per test) leaves over all `tests` together by the
    design's Fisher information. The rest of s (inverter, iron, axes) does not shrink with time.
    """
    information = sum(
        np.square(np.array(test.noise_a) / (seen_a * np.array(test.relative_std)))
        for test, seen_a in zip(tests, noise_a, strict=True)
    )
    now = np.array(std) / np.array(parameters.as_tuple())
    noise = np.minimum(1.0 / np.sqrt(information), now)
    then = np.sqrt(np.square(now) - np.square(noise) * (1.0 - 1.0 / TIMES))
    return LongerTest(TIMES * tests[-1].seconds, tuple(map(float, now)), tuple(map(float, then)))
