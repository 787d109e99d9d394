"""The linear machine that draws the current of a saturated one: its steady current follows from the circuit, solved here as phasors."""

from types import SimpleNamespace

import numpy as np
import pytest

from commissioner.estimation.numbers import DEFAULTS, NAMES, Scales
from commissioner.running.at_flux import at_flux, stator_flux_wb

PERIOD, W, SLIP_W = 2e-4, 314.0, 9.0
R_S, R_R, L_SIGMA, L_M = 1.2, 1.0, 0.0127, 0.165
SCALES = Scales(11.0, 326.0, W, 26.0, 2)
LAW = (0.1, 0.0, 0.3)


def _terminal_current(flux: complex, leakage: float, main: float, resistance: float) -> complex:
    """Of an inverse-Gamma machine behind R_s: the rotor's branch L_M beside R_R / slip, in series with the leakage."""
    branch = 1.0 / (1.0 / (1j * W * main) + SLIP_W / W / resistance)
    return 1j * W * flux / (1j * W * leakage + branch)


@pytest.mark.parametrize(
    ("side", "share", "split"), [("stator", 0.0, 1.0), ("gap", 0.4, 0.4 / 0.6), ("rotor", 1.0, 1.0)]
)
def test_the_linear_machine_at_this_flux_draws_the_same_current(side: str, share: float, split: float) -> None:
    """Behind a share of the leakage lies the saturated flux psi, which takes its own current of an inductance L_M / s(psi)."""
    saturated = 1.02 + 0.0j
    z = (abs(saturated) / (SCALES.voltage_v / W)) ** 2
    added = sum(x * z**n for n, x in enumerate(LAW, 1))
    current = _terminal_current(saturated, (1.0 - share) * L_SIGMA, L_M, R_R) + added * saturated / L_M
    stator = saturated + share * L_SIGMA * current
    turning = np.exp(1j * W * PERIOD * np.arange(600))
    volts, amperes = (1j * W * stator + R_S * current) * turning, current * turning
    window = SimpleNamespace(
        voltage=np.repeat(np.stack([volts.real, volts.imag], axis=1), 2, axis=0)[:-1],
        current=np.stack([amperes.real, amperes.imag], axis=1),
        count=600,
    )
    record = SimpleNamespace(windows=[window], period_s=PERIOD, scales=SCALES)
    values = dict.fromkeys(NAMES, 0.0) | DEFAULTS | {
        "stator_resistance": R_S, "rotor_resistance": R_R, "leakage_inductance": L_SIGMA, "magnetizing_inductance": L_M,
        "leakage_split": split, **{f"{side}_saturation_{n}": x for n, x in enumerate(LAW, 1)},
    }  # fmt: skip
    told = at_flux(record, values)  # type: ignore[arg-type]
    assert abs(stator_flux_wb(record, values)) == pytest.approx(abs(stator), rel=1e-6)  # type: ignore[arg-type]
    main = told["magnetizing_inductance_h"]
    resistance = told["rotor_resistance_ohm"]
    assert told["rotor_time_constant_s"] == pytest.approx(main / resistance, rel=1e-12)
    seen = _terminal_current(stator, told["leakage_inductance_h"], main, resistance)
    assert abs(seen - current) < 1e-6 * abs(current)
    assert main < 0.8 * L_M
