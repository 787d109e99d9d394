"""Current sensing, compiled: sampling instant, non-linearity, gain, offset, drift, pickup, noise, clipping, ADC."""

from __future__ import annotations

import math

from sim.physics import layout as at
from sim.physics.compiled import kernel

HALF_SQRT3 = 0.5 * math.sqrt(3.0)


@kernel
def between(points, place):
    """Sensed alpha and beta current at `place` (above 0, to 1) of a control period: the quartic through its five points."""
    s = 4.0 * place
    a, b = 0.0, 0.0
    for j in range(at.POINTS):
        weight = 1.0
        for m in range(at.POINTS):
            if m != j:
                weight *= (s - m) / (j - m)
        a += weight * points[j, 0]
        b += weight * points[j, 1]
    return a, b


@kernel
def phase_of(a, b, phase):
    """Phase quantity from amplitude-invariant alpha-beta."""
    if phase == 0:
        return a
    return -0.5 * a + (HALF_SQRT3 if phase == 1 else -HALF_SQRT3) * b


@kernel
def _drift(t, phase, s):
    """Slowly wandering offset (A): a ramp over a minute, a warm-up exponential, or a slow swing."""
    if s[at.S_DRIFT_U + phase] == 0.0:
        return 0.0
    if s[at.S_DRIFT_SHAPE] == 0.0:
        return s[at.S_DRIFT_U + phase] * t / s[at.S_DRIFT_TAU]
    if s[at.S_DRIFT_SHAPE] == 1.0:
        return s[at.S_DRIFT_U + phase] * (1.0 - math.exp(-3.0 * t / s[at.S_DRIFT_TAU]))
    return s[at.S_DRIFT_U + phase] * math.sin(2.6 * t / s[at.S_DRIFT_TAU])


@kernel
def _start(t, phase, s):
    """Offset (A) of a sensor whose supply was switched on with the recording."""
    if s[at.S_START_U + phase] == 0.0:
        return 0.0
    return s[at.S_START_U + phase] * math.exp(-t / s[at.S_START_TAU])


@kernel
def _pickup(t, phase, s):
    """Mains pickup (A) in one phase's sensor wire."""
    if s[at.S_PICKUP_U + phase] == 0.0:
        return 0.0
    turn = 2.0 * math.pi * s[at.S_PICKUP_HZ] * t + s[at.S_PICKUP_RAD] + 0.7 * phase
    shape = math.cos(turn)
    if s[at.S_PICKUP_SHAPE] == 1.0:
        shape += 0.3 * math.cos(3.0 * turn + 0.4) - 0.15 * math.cos(5.0 * turn)
    return s[at.S_PICKUP_U + phase] * shape


@kernel
def _bend(i, s):
    """Sensor characteristic: even and odd curvature, a soft core, or a kink at zero (fractions of full scale)."""
    x = i / s[at.S_FULL_SCALE_A]
    odd = x * x * x
    if s[at.S_NONLINEAR_SHAPE] == 1.0:
        odd = math.atan(3.0 * x) / 3.0 - x
    elif s[at.S_NONLINEAR_SHAPE] == 2.0:
        odd = x * x * abs(x) * x / (0.05 + x * x)
    return i + s[at.S_FULL_SCALE_A] * (s[at.S_QUADRATIC] * x * x + s[at.S_CUBIC] * odd)


@kernel
def sense(i, t, phase, white, s):
    """What the drive knows (A) of a phase current: everything up to but without the converter."""
    v = _bend(i, s) * s[at.S_GAIN_U + phase] + s[at.S_OFFSET_U + phase]
    v += _start(t, phase, s)
    v += _drift(t, phase, s) + _pickup(t, phase, s) + s[at.S_NOISE_A] * white
    limit = s[at.S_CLIP_A]
    if s[at.S_CLIP_SHAPE] == 1.0:
        if abs(v) > 0.9 * limit:
            over = (abs(v) - 0.9 * limit) / (0.1 * limit)
            v = math.copysign(0.9 * limit + 0.1 * limit * math.tanh(over), v)
        return v
    return min(limit, max(-limit, v))


@kernel
def convert(v, lsb):
    """Nearest code of an ADC with this step, back in the unit of `v`; a step of 0 leaves it."""
    if lsb == 0.0:
        return v
    return lsb * math.floor(v / lsb + 0.5)
