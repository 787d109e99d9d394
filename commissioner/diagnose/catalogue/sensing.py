"""Causes in sensors, converter and clock."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from commissioner.diagnose.catalogue.effect import Effect, Setting, Sizes, effect, listed
from commissioner.diagnose.kernels.kinds import CLOCK, DELAY, DRIFT, END, EVEN, GAIN, LAG, ODD, OFFSET, TONE
from commissioner.diagnose.plant import sensor_curve
from commissioner.diagnose.plant.channel_end import COUNT, reported
from commissioner.diagnose.plant.model import Term
from commissioner.diagnose.plant.sampling import RIPPLED, SHAPE

PHASES = ("u", "v", "w")


EARLY = Term("sampling_delay", "read_late", "s", DELAY, 0, 1e-6, -1e-3, 0.0)
"""Delay below zero: the current is read after the instant that it is recorded for."""


def _delay_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    delay = values.get("delay", 0.0) + values.get(EARLY.symbol, 0.0)
    return {"delay_us": (delay * 1e6, "us"), "alternating_us": (abs(values.get("alternating", 0.0)) * 1e6, "us")}


@effect(
    "sampling_delay",
    "Delay between command and sampled current",
    sign=1,
    family="linear",
    sizes=_delay_sizes,
    signature="phase proportional to frequency at excited lines, no distortion",
    confounders=("sensor_lag", "iron_loss", "rotor_skin_effect", "cable_capacitance"),
    source="computation and PWM delay: B.-H. Bae, S.-K. Sul, IEEE Trans. Ind. Appl. 39(3), 2003",
    split_by="lines closer to half the sampling rate, or a loop-back test of the sensor",
    exchanged=(EARLY,),
)
def sampling_delay(setting: Setting) -> tuple[Term, ...]:
    """Reported current is i(t - tau), tau >= 0 [s], and a part that is added and taken off from sample to sample; tau < 0 only in

    exchange for a conductance and a cable that imitate it.
    """
    return (
        Term("sampling_delay", "delay", "s", DELAY, 0, 1e-6, 0.0, 0.02),
        Term("sampling_delay", "alternating", "s", DELAY, 1, 1e-6, -0.02, 0.02),
    )


MOST_RESONANT = 0.5


FIRST_RIPPLED = 0.07
"""Of a sample, where the fit of a lag that sees the ripple begins: from none there is no way to it, a short one hardly shows."""
LEAST_SHAPE = 0.02
"""Of a lag, from which on it may be a delay of 2 % of it, and a lag of first order."""


def _lag_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    """The sum, and how much of it a delay before a lag of first order may be, whose second order is the same."""
    lag = values.get("lag", 0.0) + values.get("rippled", 0.0)
    sizes = {"time_constant_us": (lag * 1e6, "us")}
    if (shape := values.get("shape", 0.0)) > LEAST_SHAPE and not values.get("rippled"):
        sizes["may_be_delay_us"] = (lag * 1e6 * (1.0 - max(1.0 - 2.0 * shape, 0.0) ** 0.5), "us")
    return sizes


@effect(
    "sensor_lag",
    "Lag of the current sensors",
    sign=1,
    family="linear",
    sizes=_lag_sizes,
    signature="phase and a roll-off with the square of frequency at excited lines, no distortion",
    confounders=("sampling_delay", "iron_loss", "rotor_skin_effect"),
    source="anti-alias filter or sensor bandwidth: tau dy/dt = i - y, once or twice",
    split_by="lines closer to half the sampling rate, or a loop-back test of the sensor",
    either=(("lag", "shape"), ("rippled", "shape")),
)
def sensor_lag(setting: Setting) -> tuple[Term, ...]:
    """Sum S >= 0 [s] of the time constants of 1 / (1 + s S + s² q S²) and its shape q: 0 one lag, 1/4 two equal ones, 1/2

    Butterworth's; of a current without ripple, or of one that ripples with the inverter's pulses (`ripple`). The size is the sum.
    """
    return (
        Term("sensor_lag", "lag", "s", LAG, 0, 1e-6, 0.0, 0.02),
        Term("sensor_lag", "shape", "1", LAG, SHAPE, 1e-2, 0.0, MOST_RESONANT),
        Term(
            "sensor_lag",
            "rippled",
            "s",
            LAG,
            RIPPLED,
            1e-6,
            0.0,
            0.02,
            start=FIRST_RIPPLED * setting.facts.sample_period_s,
        ),
    )


def _offset_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    return {f"offset_{p}_a": (values[p], "A") for p in PHASES if p in values}


@effect(
    "sensor_offset",
    "Offset of the current sensors",
    sign=0,
    family="dc",
    sizes=_offset_sizes,
    signature="a constant, also with the inverter off; the three need not add up to zero",
    confounders=("remanence", "shaft_motion"),
    source="data sheets of open-loop Hall sensors: 0.2 to 1 % of range",
    split_by="record one second before the inverter is switched on",
)
def sensor_offset(setting: Setting) -> tuple[Term, ...]:
    """Constant [A] per phase."""
    return tuple(Term("sensor_offset", PHASES[k], "A", OFFSET, k, 1e-3) for k in range(setting.facts.phases))


DRIFTS = {
    "": 1.0,
    "_quarter": (1.0 - np.exp(-4.0)) / 4.0,
    "_sixteenth": (1.0 - np.exp(-16.0)) / 16.0,
    "_swing": 0.0,
    "_turn": 0.0,
}
"""Part of a drift's first slope that is left as its mean slope over the whole recording: evenly, settling, swinging."""


def _drift_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    return {
        f"drift_{p}_a_per_min": (float(sum(share * values.get(p + k, 0.0) for k, share in DRIFTS.items())), "A/min")
        for p in PHASES
        if p in values
    }


@effect(
    "sensor_drift",
    "Offset of the current sensors that drifts",
    sign=0,
    family="dc",
    sizes=_drift_sizes,
    signature="a slow ramp of the mean over the whole recording",
    confounders=("sensor_offset", "remanence"),
    source="temperature drift of Hall sensors",
    split_by="record one second before and after the test with the inverter off",
)
def sensor_drift(setting: Setting) -> tuple[Term, ...]:
    """Ramp [A/min] per phase, zero at the first sample, two more that settle within the recording (a warming sensor), and a

    swing once to and fro (a door that opens).
    """
    return tuple(
        Term("sensor_drift", PHASES[k] + shape, "A/min", DRIFT, k + 3 * m, 1e-3)
        for m, shape in enumerate(DRIFTS)
        for k in range(setting.facts.phases)
    )


def _gain_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    return {f"gain_{p}_over_u": (values[p], "1") for p in PHASES if p in values}


@effect(
    "sensor_gain_mismatch",
    "Current sensors of unequal gain",
    sign=0,
    family="axis",
    sizes=_gain_sizes,
    signature="currents that do not add up to zero in proportion to the signal; R and L differ alike with the axis",
    confounders=("inductance_anisotropy", "resistance_anisotropy", "stator_heating"),
    source="gain tolerance 0.5 to 2 %; the common gain is not visible from terminals",
    split_by="three sensors, three or more axes",
)
def sensor_gain_mismatch(setting: Setting) -> tuple[Term, ...]:
    """Relative gain of v (and w) against u."""
    if setting.facts.phases < 3 and setting.axes < 2:
        return ()
    return tuple(
        Term("sensor_gain_mismatch", PHASES[k], "1", GAIN, k, 1e-3, -0.5, 0.5) for k in range(1, setting.facts.phases)
    )


def _nonlinearity_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    """Mean of the sensors, at full scale of the square and the cubic that err as much as theirs do at the largest current reported."""
    peak = setting.layout.channel_ends_a / setting.layout.nonlinearity_scale_a
    out: Sizes = {}
    for part, of, order in (("even", sensor_curve.even, 1), ("odd", sensor_curve.odd, 2)):
        errors = of(peak)[0] / peak**order
        weights = [[values.get(f"{part}_{p}{bend}", 0.0) for p in PHASES[: peak.size]] for bend in BENDS]
        seen = np.array([f"{part}_{p}" in values for p in PHASES[: peak.size]])
        mean = float((np.array(weights) * errors).sum(axis=0)[seen].mean()) if seen.any() else 0.0
        out = {**out, f"{part}_at_full_scale": (mean, "1")}
    return out


BENDS = ("", *(f"_bend_{k}" for k in range(1, sensor_curve.COUNT)))
"""Of the names of a sensor curve's numbers: its polynomial, and bends that settle."""


@effect(
    "sensor_nonlinearity",
    "Current sensors that are not straight",
    sign=0,
    family="even",
    sizes=_nonlinearity_sizes,
    signature="even or odd lines that no impedance has filtered, in each sensor by its own current",
    confounders=("leakage_saturation", "dc_link_sag"),
    source="reported = i (1 + n2 i/I_fs + n3 (i/I_fs)^2 + ...), I_fs twice the rated peak; linearity figures of data sheets",
    split_by="DC staircase",
    either=tuple(
        tuple(f"{part}_{p}{bend}" for part in ("even", "odd") for bend in bends for p in PHASES)
        for bends in (BENDS[:1], BENDS)
    ),
)
def sensor_nonlinearity(setting: Setting) -> tuple[Term, ...]:
    """n2 and n3 of each sensor, relative to full scale; or these and bends that settle (`sensor_curve`)."""
    return tuple(
        Term("sensor_nonlinearity", f"{part}_{PHASES[k]}{bend}", "1", kind, k + 3 * m, 1e-3)
        for part, kind in (("even", EVEN), ("odd", ODD))
        for m, bend in enumerate(BENDS)
        for k in range(setting.facts.phases)
    )


def _none(setting: Setting, values: Mapping[str, float]) -> Sizes:
    return {}


@effect(
    "quantization",
    "Coarse steps of the converter",
    sign=1,
    family="noise",
    sizes=_none,
    signature="currents lie on a grid; flat noise of step / sqrt(12), independent of level",
    confounders=(),
    source="B. Widrow, I. Kollar, Quantization Noise, 2008",
    split_by="look at the histogram",
)
def quantization(setting: Setting) -> tuple[Term, ...]:
    """Found in the audit (step [A]), not by a fit: it has no waveform of its own."""
    return ()


def _end_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    """Of the channel that bends most, where it comes to the largest current it reports: slope lost, current not reported."""
    ends_a = setting.layout.channel_ends_a
    shares = np.stack([listed(values, f"end_{p}", COUNT) for p in PHASES[: ends_a.size]])
    true_a = np.linspace(0.0, 3.0, 601) * ends_a[:, None]
    seen_a = reported(true_a, shares, ends_a)
    found = []
    for true, seen, end_a in zip(true_a, seen_a, ends_a, strict=True):
        top = int(np.argmax(seen >= min(NEAR_THE_END * end_a, float(seen.max()))))
        beyond = min(top + round(AT_THE_END * end_a / float(true[1])), true.size - 1)
        slope = float((seen[beyond] - seen[top]) / max(float(true[beyond] - true[top]), 1e-12))
        found.append((1.0 - slope, float(end_a), float(true[beyond] - seen[beyond])))
    slope, limit_a, missing_a = max(found)
    return {"limit_a": (limit_a, "A"), "slope_lost": (slope, "1"), "missing_at_limit_a": (missing_a, "A")}


NEAR_THE_END, AT_THE_END = 0.985, 0.04
"""Of the largest current reported: from where, and over how much current more, a slope counts as the channel's last."""


@effect(
    "clipping",
    "Current channel at its limit",
    sign=1,
    family="odd",
    sizes=_end_sizes,
    signature="samples pile up at one value, or bend towards it: what lies beyond is not reported",
    confounders=("sensor_nonlinearity", "leakage_saturation"),
    source="saturated converter, amplifier or transformer core",
    split_by="reduce the level",
)
def clipping(setting: Setting) -> tuple[Term, ...]:
    """Shares of the slope that each channel loses towards its end. Samples that pile up there are masked by the audit."""
    return tuple(
        Term("clipping", f"end_{PHASES[p]}_{k}", "1", END, p * COUNT + k, 1e-3, 0.0, 1.0)
        for p in range(setting.facts.phases)
        for k in range(COUNT)
    )


def _mains_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    out: dict[str, tuple[float, str]] = {}
    for base in (50, 60):
        parts = np.array([v for k, v in values.items() if k.startswith(f"mains_{base}_")])
        if parts.size:
            out[f"amplitude_{base}_hz_a"] = (float(np.sqrt(2.0 * np.mean(parts**2))), "A")
    return out


@effect(
    "mains_pickup",
    "Mains hum in the current channels",
    sign=0,
    family="non-periodic",
    sizes=_mains_sizes,
    signature="a line at 50 or 60 Hz that does not depend on the excitation",
    confounders=("dc_link_ripple",),
    source="a cos wt + b sin wt per channel, frequency refined on the data",
    split_by="record one second with the inverter off",
)
def mains_pickup(setting: Setting) -> tuple[Term, ...]:
    """Cosine and sine amplitude [A] per channel at the refined mains frequency."""
    record = setting.record
    names = [n for n in record.channel_names if n.startswith("mains_")]
    return tuple(
        Term(
            "mains_pickup",
            f"{n}_{PHASES[k]}_{s.uid}",
            "A",
            TONE,
            3 * record.channel(n) + k,
            1e-3,
            segment=s.uid,
            channel=n,
        )
        for s in record.segments
        for n in names
        for k in range(record.facts.phases)
    )


def _clock_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    wander = float(np.hypot(values.get("wander_cos", 0.0), values.get("wander_sin", 0.0)))
    drift = values.get("drift", 0.0) + values.get("running", 0.0)
    sizes = {"drift_ppm": (drift, "ppm"), "wander_ppm": (wander, "ppm")}
    return sizes if abs(drift) >= wander else dict(reversed(sizes.items()))


RESTARTS, RUNS_ON = ("drift", "wander_cos", "wander_sin"), ("running",)
"""A clock that is set anew with every segment, and one that is not."""


@effect(
    "clock_drift",
    "Current and voltage clocks that run apart",
    sign=0,
    family="drifting",
    sizes=_clock_sizes,
    either=(RESTARTS, RUNS_ON),
    signature="a delay that grows with time within the segment, or over the whole recording",
    confounders=("stator_heating", "lost_samples"),
    source="i(t - eps t), eps in ppm; crystal tolerance",
    split_by="a longer segment",
)
def clock_drift(setting: Setting) -> tuple[Term, ...]:
    """eps [ppm] from the start of each segment, and a rate that wanders; or from the start of the recording: a clock that runs

    on while the next segment is prepared.
    """
    symbols = RESTARTS + (RUNS_ON if setting.spans_segments else ())
    return tuple(Term("clock_drift", symbol, "ppm", CLOCK, k, 0.01, -2e4, 2e4) for k, symbol in enumerate(symbols))


@effect(
    "lost_samples",
    "Samples lost without a gap in the time stamps",
    sign=1,
    family="drifting",
    sizes=_none,
    signature="the delay jumps by whole samples at one instant",
    confounders=("clock_drift",),
    source="i(t + n T) after t_0; found by a scan over t_0",
    split_by="number the samples in the logger",
)
def lost_samples(setting: Setting) -> tuple[Term, ...]:
    """Found by a scan over all instants and put right in the data (number of samples), not by a fit."""
    return ()


ENTRIES: tuple[Effect, ...] = (
    sampling_delay,
    sensor_lag,
    sensor_offset,
    sensor_drift,
    sensor_gain_mismatch,
    sensor_nonlinearity,
    quantization,
    clipping,
    mains_pickup,
    clock_drift,
    lost_samples,
)
