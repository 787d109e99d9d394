"""Can the excitation carry four parameters? Refusals that say which combination it does fix."""

from __future__ import annotations

import math

import numpy as np

from commissioner.errors import DataRefused
from commissioner.identify.batch.segments import BatchFit
from commissioner.identify.intake.audit import Audit
from commissioner.identify.intake.stretches import Stretch, tones_in
from commissioner.motor.circuit import SYMBOLS, InverseGamma
from commissioner.motor.nameplate import Nameplate
from commissioner.motor.standstill import admittance_s

WORST_RELATIVE_STD = 0.25
PLAUSIBLE_CURRENT = (1e-3, 10.0)
"""Largest current of a test, of the rated peak."""
PLAUSIBLE_IMPEDANCE = (1e-3, 30.0)
"""Rms voltage over rms current of a test, of the rated impedance; a resistance alone is 0.004 to 0.15 of it."""

LARGEST_SHARE_BESIDE, LARGEST_MISFIT = 0.02, 10.0


def require_amperes(examined: Audit, plate: Nameplate) -> None:
    """Currents of the size a test on this motor can have: other units, or another motor's plate, show here."""
    peak = max(float(np.max(np.abs(s.current_a))) for s in examined.stretches if s.is_excited)
    _require_near(
        "currents", f"largest current along the axis {peak:.3g} A", peak, plate.rated_current_peak_a, "A",
        PLAUSIBLE_CURRENT, "give currents in ampere",
    )  # fmt: skip


def require_volts(examined: Audit, plate: Nameplate) -> None:
    """A voltage in other units than volts makes an impedance no motor of this plate has."""
    excited = [s for s in examined.stretches if s.is_excited]
    volts = math.sqrt(sum(float(np.sum(s.voltage_v**2)) for s in excited))
    amperes = math.sqrt(sum(float(np.sum(s.current_a**2)) for s in excited))
    rated_ohm = plate.rated_voltage_v / (math.sqrt(3.0) * plate.rated_current_a)
    _require_near(
        "voltages", f"voltage over current {volts / amperes:.3g} ohm (rms)", volts / amperes, rated_ohm, "ohm",
        PLAUSIBLE_IMPEDANCE, "give voltages in volt and currents in ampere",
    )  # fmt: skip


def _require_near(
    what: str, seen: str, value: float, rated: float, unit: str, limits: tuple[float, float], remedy: str
) -> None:
    """DataRefused where `value` is not within `limits` times its rated one."""
    if not limits[0] < value / rated < limits[1]:
        raise DataRefused(
            f"the {what} do not fit the nameplate",
            step="check the excitation",
            value=seen,
            limit=f"{limits[0]:g} to {limits[1]:g} times {rated:.3g} {unit}",
            remedy=f"{remedy}, and the nameplate of the motor that was recorded",
        )


def require_tones(examined: Audit, period_s: float) -> None:
    """One tone fixes two numbers, not four: say which."""
    if any(s.kind in ("staircase", "biased") for s in examined.stretches if s.is_excited):
        return
    lines = [tones_in(s.voltage_v, period_s) for s in examined.stretches if s.is_excited]
    distinct = sorted({round(f, 2) for stretch in lines for f in stretch})
    groups = [f for k, f in enumerate(distinct) if k == 0 or f > 1.2 * distinct[k - 1]]
    if len(groups) > 1 or not groups:
        return
    stretch = max((s for s in examined.stretches if s.is_excited), key=lambda s: s.voltage_v.size)
    frequency = groups[0]
    if _share_beside(stretch, frequency, period_s) > LARGEST_SHARE_BESIDE:
        return
    time = np.arange(stretch.voltage_v.size) * period_s
    carrier = np.exp(-2j * np.pi * frequency * time) * np.hanning(time.size)
    impedance = complex(np.sum(stretch.voltage_v * carrier) / np.sum(stretch.current_a * carrier))
    raise DataRefused(
        "one tone cannot fix four parameters",
        step="check the excitation",
        value=f"one tone of {frequency:.4g} Hz",
        limit="two tones at least, four for a check of the model",
        remedy=(
            f"only this combination can be had: R_s + R_R w^2 L_M^2/(R_R^2 + w^2 L_M^2) = {impedance.real:.5g} ohm and "
            f"L_sigma + L_M R_R^2/(R_R^2 + w^2 L_M^2) = {impedance.imag / (2 * math.pi * frequency):.5g} H at "
            f"w = 2 pi {frequency:.4g} 1/s; excite several tones from below 1 Hz to above 20 Hz"
        ),
    )


def _share_beside(stretch: Stretch, frequency_hz: float, period_s: float) -> float:
    """Part of the alternating voltage's power that is not around this frequency: a sweep or a square wave is no tone."""
    x = (stretch.voltage_v - np.mean(stretch.voltage_v)) * np.hanning(stretch.voltage_v.size)
    power = np.abs(np.fft.rfft(x)) ** 2
    f = np.fft.rfftfreq(x.size, period_s)
    around = (np.abs(f - frequency_hz) < 0.3 * frequency_hz) | (np.abs(f - frequency_hz) < 4.0 / (x.size * period_s))
    return float(np.sum(power[~around]) / np.sum(power))


def require_positive(machine: InverseGamma, flux_wb: float) -> InverseGamma:
    """The machine itself; DataRefused where the fit's iron, taken to this peak stator flux, leaves a value at zero or below."""
    for name, value in zip(SYMBOLS, machine.as_tuple(), strict=True):
        if not value > 0.0:
            raise DataRefused(
                f"the excitation does not fix {name}",
                step="identify",
                value=f"{value:.3g} at a peak stator flux of {flux_wb:.3g} Wb",
                limit="above zero",
                remedy="excite with more current, or record longer",
            )
    return machine


def require_conditioned(batch: BatchFit) -> None:
    machine, covariance = batch.inverse_gamma_at(0.0)
    require_positive(machine, 0.0)
    relative = np.sqrt(np.diag(covariance)) / np.array(machine.as_tuple())
    if not np.all(np.isfinite(relative)) or np.max(relative) > WORST_RELATIVE_STD:
        worst = int(np.argmax(np.where(np.isfinite(relative), relative, np.inf)))
        if _misfit(batch) > LARGEST_MISFIT:
            raise DataRefused(
                "no motor answers this voltage with this current",
                step="identify",
                value=f"the best fit misses {batch.noise_a:.3g} A rms, {_misfit(batch):.0f} times the noise",
                limit=f"{LARGEST_MISFIT:g} times the noise",
                remedy="check that voltage and current are of the same instants (voltage_axis_v holds from its own row's "
                "time to the next), and of the named axis",
            )
        impedance = 1.0 / admittance_s(machine, np.array([1.0, 10.0]))
        raise DataRefused(
            f"the excitation does not fix {SYMBOLS[worst]}",
            step="identify",
            value=f"relative standard error {relative[worst]:.0%}",
            limit=f"{WORST_RELATIVE_STD:.0%}",
            remedy="excite more tones between the machine's poles, or record longer; the fit's impedance at 1 Hz is "
            f"{impedance[0]:.4g} ohm, at 10 Hz {impedance[1]:.4g} ohm; hold the shaft still: a cage that turns fast hides L_M",
        )


def _misfit(batch: BatchFit) -> float:
    """Residual over its own noise (from second differences): what is left beside noise is smooth."""
    noise = float(np.median([np.var(np.diff(r, 2)) for r in batch.residuals])) / 6.0
    return batch.noise_a / math.sqrt(max(noise, 1e-300))
