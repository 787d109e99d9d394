"""Causes in iron, rotor, winding and shaft."""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.catalogue.effect import Effect, Setting, Sizes, effect, listed, spline_value
from commissioner.diagnose.catalogue.regressors import FINE_SPEED_SPLINE, SPEED_SPLINE
from commissioner.diagnose.intake.record import Record
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.kernels.memory import loop_width
from commissioner.diagnose.plant.model import Term

Array = NDArray[np.float64]


def _saturation_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    """Extra current against the iron at its most permeable (that of sheet at small flux is lower) where it is largest: at the largest

    flux, of iron that is only hard to magnetize at first below it.
    """
    layout = setting.layout
    weights = listed(values, "curve", layout.iron_vectors.shape[0])
    grid = np.linspace(0.0, setting.iron_flux_wb, 60)
    curve = np.array([spline_value(layout.iron_vectors, weights, layout.iron_top_wb, float(flux)) for flux in grid])
    extra = (curve - curve.min()) * grid
    most = int(np.argmax(extra))
    return {"extra_current_a": (float(extra[most]), "A"), "at_flux_wb": (float(grid[most]), "Wb")}


FOOT_SHARE = 0.5
"""Of the flux reached, at which a foot that ends within three intervals of the dictionary has ended."""


@effect(
    "magnetizing_saturation",
    "Saturation of the main flux path",
    sign=1,
    family="odd",
    sizes=_saturation_sizes,
    signature="odd lines of the lowest tone, growing very fast with level; even lines with DC bias",
    confounders=("magnetic_hysteresis", "dc_link_sag"),
    source="i_M = psi/L_M (1 + b |psi/psi_n|^S): Qu, Ranta, Hinkkanen, Luomi, IEEE Trans. Ind. Appl. 48(3), 2012",
    split_by="repeat the lowest tone at half and at full flux",
)
def magnetizing_saturation(setting: Setting) -> tuple[Term, ...]:
    """Extra magnetizing current G(|psi|) psi, G(0) = 0, a cubic spline over the flux reached, rising beyond half of

    it (below, the permeability of steel may still grow: Rayleigh's foot).
    `split` moves the saturating flux between rotor (-0.5) and stator (+0.5) side of the leakage.
    """
    count = setting.layout.iron_vectors.shape[0]
    step = setting.facts.rated_current_peak_a / max(setting.iron_flux_wb, 1e-9) * 0.01
    # on twice the knots what falls at k falls from 2 k - 1 to 2 k + 2: a curve must not lose its foot there
    foot = FOOT_SHARE * (count - 1) - 2.0
    curve = tuple(
        Term("magnetizing_saturation", f"curve_{k}", "A/Wb", kinds.IRON_CURVE, k, step, 0.0 if k > foot else -np.inf)
        for k in range(count)
    )
    return (*curve, _split("magnetizing_saturation"))


def _split(effect_name: str) -> Term:
    """Where between rotor (-0.5) and stator (+0.5) side of the leakage the iron's flux is taken."""
    return Term(effect_name, "split", "1", kinds.NU, 0, 0.1, -0.5, 0.5)


CARRIED = Term("magnetic_hysteresis", "carried", "1", kinds.MEMORY, 0, 1.0, 0.0, 1.0, start=1.0)
"""1: the iron goes into a segment with what it remembers of the one before; 0: it has been demagnetized, or starts anew."""


def _hysteresis_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    """Largest current of the memory, and the flux at which it is, of those reached."""
    rates = setting.layout.stop_radius_wb[:, 1]
    fluxes = np.linspace(setting.iron_flux_wb, 0.0, 21)
    currents = np.array([[loop_width(flux, 0.0, rate)[0] for rate in rates] for flux in fluxes]) @ listed(
        values, "loop", rates.size
    )
    widest = int(np.argmax(currents))
    return {"coercive_current_a": (float(currents[widest]), "A"), "at_flux_wb": (float(fluxes[widest]), "Wb")}


@effect(
    "magnetic_hysteresis",
    "Hysteresis of the iron",
    sign=1,
    family="odd",
    sizes=_hysteresis_sizes,
    signature="a loop that does not depend on rate; broad odd lines falling slowly with order",
    confounders=("magnetizing_saturation", "dead_time", "rotor_skin_effect"),
    source="stop operators: M. Brokate, J. Sprekels, Hysteresis and Phase Transitions, 1996; exponential: P. R. Dahl, 1968",
    split_by="repeat the lowest tone at several amplitudes",
    exchanged=(CARRIED,),
)
def magnetic_hysteresis(setting: Setting) -> tuple[Term, ...]:
    """Extra current sum h_k w_k z_k / r_k, h_k >= 0 [A], z_k memory operators of the iron flux (stops and exponential

    ones) with fixed scales r_k, some of them with a factor w_k that grows with the flux, or falls (`memory.loop_width`).

    `split` as with saturation.
    """
    loops = tuple(
        Term("magnetic_hysteresis", f"loop_{k}", "A", kinds.STOP, k, 0.01, 0.0, np.inf)
        for k in range(setting.layout.stop_radius_wb.shape[0])
    )
    return (*loops, _split("magnetic_hysteresis"))


SAME_FLUX = 0.2
"""Of their mean: fluxes left before the segments that differ by less are one."""


def _remanence_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    """The one flux that is left before every segment (their mean), or the largest."""
    pairs: dict[str, list[float]] = {}
    for name, value in values.items():
        pairs.setdefault(name.rpartition("_")[2], []).append(value)
    vectors = np.array([p for p in pairs.values() if len(p) == 2]).reshape(-1, 2)
    mean = vectors.mean(axis=0) if vectors.size else np.zeros(2)
    apart = np.linalg.norm(vectors - mean, axis=1).max(initial=0.0)
    is_one = apart < SAME_FLUX * np.linalg.norm(mean)
    size = np.linalg.norm(mean) if is_one else np.linalg.norm(vectors, axis=1).max(initial=0.0)
    return {"flux_wb": (float(size), "Wb")}


@effect(
    "remanence",
    "Flux left in the iron before the test",
    sign=1,
    family="start",
    sizes=_remanence_sizes,
    signature="a transient at the start of a segment that decays with the rotor time constant",
    confounders=("sensor_offset", "magnetic_hysteresis", "shaft_motion"),
    source="initial state of the flux equation; P. Vas, Sensorless Vector and Direct Torque Control, 1998",
    split_by="wait longer before the segment, or start it with the opposite polarity",
)
def remanence(setting: Setting) -> tuple[Term, ...]:
    """Initial flux vector (alpha, beta) [Wb] of every segment that starts at rest."""
    step = 0.01 * max(setting.iron_flux_wb, 1e-6)
    return tuple(
        Term("remanence", f"{axis}_{s.uid}", "Wb", kinds.INITIAL_FLUX, c, step, segment=s.uid)
        for s in setting.record.segments
        if s.starts_at_rest
        for c, axis in enumerate(("alpha", "beta"))
    )


def _leakage_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    """Drop of the inductance (flux over current) from no current to the largest that the leakage path carries.

    The path's own inductance is L_sigma with the stator current's leakage, (1 + L_sigma/L_M) L_sigma with the rotor's.
    """
    layout, flux = setting.layout, setting.leakage_flux_wb
    own_h = setting.nominal[2] * (1.0 + (0.5 + values.get("split", 0.0)) * layout.leak_ratio)
    weights = listed(values, "curve", layout.leak_vectors.shape[0])
    growth = own_h * spline_value(layout.leak_vectors, weights, layout.leak_top_wb, flux)
    return {"inductance_drop": (growth / (1.0 + growth), "1"), "at_current_a": (flux / own_h * (1.0 + growth), "A")}


@effect(
    "leakage_saturation",
    "Leakage path that saturates with current",
    sign=1,
    family="odd",
    sizes=_leakage_sizes,
    signature="odd intermodulation around the highest tones, growing with the cube of the current",
    confounders=("sensor_nonlinearity", "dc_link_sag"),
    source="T. A. Lipo, A. Consoli, IEEE Trans. Ind. Appl. IA-20(1), 1984; T. Tuovinen et al., IEEE ECCE 2011",
    split_by="DC staircase with a small high tone on top",
)
def leakage_saturation(setting: Setting) -> tuple[Term, ...]:
    """Extra inverse leakage S(|phi|) >= 0 [1/H], a rising cubic spline with S(0) = 0 over the leakage flux reached.

    `split` moves it between the leakage of the stator current (-0.5) and of the rotor current (+0.5).
    """
    count = setting.layout.leak_vectors.shape[0]
    step = 0.01 * setting.facts.current_peak_a / setting.layout.leak_top_wb
    curve = tuple(
        Term("leakage_saturation", f"curve_{k}", "1/H", kinds.LEAKAGE_CURVE, k, step, 0.0, np.inf) for k in range(count)
    )
    return (*curve, Term("leakage_saturation", "split", "1", kinds.LEAK_SPLIT, 0, 0.1, -0.7, 0.7))


def _skin_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    """R_R(f_N) / R_R(0) - 1 of the branches beside R_R."""
    rated = float(setting.facts.metadata.get("rated_frequency_hz", 50.0))
    branches = listed(values, "branch", setting.layout.branch_time_s.size)
    slow = 1.0 / setting.nominal[1] + branches.sum()
    fast = 1.0 / setting.nominal[1] + (branches / (1.0 + 2j * np.pi * rated * setting.layout.branch_time_s)).sum()
    return {"resistance_rise_at_rated_frequency": (float((1.0 / fast).real * slow - 1.0), "1")}


@effect(
    "rotor_skin_effect",
    "Current displacement in the rotor bars",
    sign=1,
    family="linear",
    sizes=_skin_sizes,
    signature="rotor resistance rises and leakage falls between 50 and 600 Hz; excited lines only, proportional to level",
    confounders=("iron_loss", "sampling_delay", "sensor_lag", "cable_capacitance"),
    source="ladder network of a bar: A. Levy, H. Auinger, cited in Babb & Williams, Trans. AIEE 70, 1951",
    split_by="tones on both sides of the corner, 20 Hz to 1 kHz",
)
def rotor_skin_effect(setting: Setting) -> tuple[Term, ...]:
    """Rotor branches g_k / (1 + s T_k) beside 1/R_R, g_k >= 0 [S], corners from 12.5 to 800 Hz, two thirds of an octave apart, and closer

    where one acts. No branch carries more than a hundred times the motor's own conductance: a bar's resistance rises tenfold at most.
    """
    # the box ends at 6 times the resistance seen at the tones (`nominal.bare_layout`)
    largest = 600.0 / setting.layout.nominal_box[1][1] if np.isfinite(setting.layout.nominal_box[1][1]) else np.inf
    return tuple(
        Term("rotor_skin_effect", f"branch_{k}", "S", kinds.BRANCH, k, 0.01, 0.0, largest)
        for k, time in enumerate(setting.layout.branch_time_s)
        if time > 0.0
    )


EDGE = Term("iron_loss", "edge", "F", kinds.CABLE, 0, 1e-9, 0.0, 1e-3)
"""Charge per volt of a step of the command that a sample at that instant has seen already: conductance times period, all of it."""


def _loss_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    """At low frequency, where eddy currents fill the sheet."""
    return {"conductance_ms": (sum(v for k, v in values.items() if k != EDGE.symbol) * 1e3, "mS")}


@effect(
    "iron_loss",
    "Eddy-current loss of the iron",
    sign=1,
    family="linear",
    sizes=_loss_sizes,
    signature="resistance rises with the square of frequency up to more than 1 kHz; looks like a lead",
    confounders=("rotor_skin_effect", "sampling_delay", "cable_capacitance"),
    source="conductance across the stator flux: E. Levi, IEEE Trans. Energy Convers. 10(2), 1995",
    split_by="tones above 1 kHz, or a running no-load test",
    exchanged=(EDGE,),
)
def iron_loss(setting: Setting) -> tuple[Term, ...]:
    """Conductance g >= 0 [S] fed by the stator's induced voltage, and eddy paths g_k / (1 + s T_k) that lag behind it, with

    corners from 150 Hz to 1 kHz.
    """
    paths = tuple(
        Term("iron_loss", f"eddy_{k}", "S", kinds.BRANCH, k, 1e-4, 0.0, 0.2)
        for k, time in enumerate(setting.layout.branch_time_s)
        if time < 0.0
    )
    return (Term("iron_loss", "conductance", "S", kinds.IRON_LOSS, 0, 1e-4, 0.0, 0.2), *paths)


def _speed_splines(record: Record) -> list[str]:
    """Channels that a speed is made of: the finest there are."""
    splines = [n for n in record.channel_names if n.startswith(SPEED_SPLINE)]
    return [n for n in splines if n.startswith(FINE_SPEED_SPLINE)] or splines


def _motion_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    """Root mean square over the time in which the command would show it: without flux a speed leaves no trace."""
    power, weight = 0.0, 0.0
    for segment, channels in zip(setting.record.segments, setting.record.channels, strict=True):
        shown = segment.voltage_axis_v**2
        for name, value in values.items():
            spline, _, uid = name.rpartition("_")
            if uid == str(segment.uid) and spline.startswith(SPEED_SPLINE):
                mine = float(shown @ channels[:, setting.record.channel(spline)])
                power, weight = power + mine * value**2, weight + mine
    return {"speed_rad_per_s": (float(np.sqrt(power / weight)) if weight else 0.0, "rad/s")}


@effect(
    "shaft_motion",
    "Shaft that moves during the test",
    sign=0,
    family="cross",
    sizes=_motion_sizes,
    course=SPEED_SPLINE,
    signature="current in the axis that gets no voltage, proportional to the rotor flux",
    confounders=("sensor_offset", "sensor_drift", "inductance_anisotropy"),
    source="d psi_R/dt = ... + omega J psi_R (electrical speed); W. Leonhard, Control of Electrical Drives, ch. 10",
    split_by="block the shaft",
)
def shaft_motion(setting: Setting) -> tuple[Term, ...]:
    """Electrical speed [rad/s] as a cubic spline over time, a knot every 0.4 s of each segment, or closer where the record has such

    splines; and where in the pause before a segment it carried the flux left from the segment before that.
    """
    speed = tuple(
        Term(
            "shaft_motion",
            f"{n}_{s.uid}",
            "rad/s",
            kinds.OMEGA,
            setting.record.channel(n),
            0.1,
            segment=s.uid,
            channel=n,
        )
        for s in setting.record.segments
        for n in _speed_splines(setting.record)
    )
    carried = tuple(
        Term("shaft_motion", f"{name}_{s.uid}", "1", kinds.CARRY, k, 0.01, -2.0, 2.0, segment=s.uid)
        for before, s in itertools.pairwise(setting.record.segments)
        if before.file == s.file and s.starts_at_rest
        for k, name in enumerate(("along", "across"))
    )
    return (*speed, *carried)


def _anisotropy_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    parts = {p: [values.get(f"{p}_{c}", 0.0) for c in ("cos", "sin")] for p in ("leakage", "magnetizing")}
    return {
        f"{p}_anisotropy": (float(np.linalg.norm(pair)), "1")
        for p, pair in parts.items()
        if any(pair) or p == "leakage"
    }


@effect(
    "inductance_anisotropy",
    "Inductance that depends on the axis",
    sign=0,
    family="axis",
    sizes=_anisotropy_sizes,
    signature="leakage differs with the axis angle (period 180 degrees) and couples the axes; no distortion",
    confounders=("sensor_gain_mismatch", "resistance_anisotropy"),
    source="second-harmonic tensor of eccentricity and slotting: M. Linke, R. Kennel, J. Holtz, IEEE IECON 2003",
    split_by="three or more axes",
)
def inductance_anisotropy(setting: Setting) -> tuple[Term, ...]:
    """1/L_sigma times (1 + [c s; s -c]), and the same for 1/L_M; needs at least two axes.

    R_R tilts with the two: K = L_m / (L_m + L_rl) turns the T circuit into this one, R_R = K^2 R_r, so that with the share
    y = 0.5 + split of the leakage on the rotor's side its tilt is 2 y x / (1 + x) (leakage - magnetizing), x = L_sigma / L_M.
    """
    if setting.axes < 2:
        return ()
    parts = (("leakage", kinds.LEAKAGE_ANISOTROPY), ("magnetizing", kinds.MAGNETIZING_ANISOTROPY))
    tilts = tuple(
        Term("inductance_anisotropy", f"{part}_{name}", "1", kind, c, 0.01, -0.5, 0.5)
        for part, kind in parts
        for c, name in enumerate(("cos", "sin"))
    )
    return (*tilts, Term("inductance_anisotropy", "split", "1", kinds.ANISOTROPY_SPLIT, 0, 0.1, -0.5, 0.5))


def _resistance_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    return {
        f"{p}_anisotropy": (float(np.hypot(values.get(f"{p}_cos", 0.0), values.get(f"{p}_sin", 0.0))), "1")
        for p in ("stator", "rotor")
        if f"{p}_cos" in values
    }


@effect(
    "resistance_anisotropy",
    "Resistance that depends on the axis",
    sign=0,
    family="axis",
    sizes=_resistance_sizes,
    signature="resistance differs between phases (joint, winding) or rotor directions (broken bar); excited lines only",
    confounders=("sensor_gain_mismatch", "stator_heating", "inductance_anisotropy"),
    source="R_x = R_s (1 + c cos 2 theta_x + s sin 2 theta_x); rotor: same tensor on R_R",
    split_by="three or more axes, first axis repeated",
)
def resistance_anisotropy(setting: Setting) -> tuple[Term, ...]:
    """Relative second-harmonic tensors of R_s (phase resistances) and R_R; needs at least two axes."""
    if setting.axes < 2:
        return ()
    channel = setting.record.channel
    stator = tuple(
        Term(
            "resistance_anisotropy",
            f"stator_{n}",
            "1",
            kinds.PHASE_RESISTANCE,
            channel(f"phase_{n}_u"),
            0.01,
            -0.5,
            0.5,
        )
        for n in ("cos", "sin")
    )
    rotor = tuple(
        Term("resistance_anisotropy", f"rotor_{n}", "1", kinds.ROTOR_ANISOTROPY, c, 0.01, -0.5, 0.5)
        for c, n in enumerate(("cos", "sin"))
    )
    return stator + rotor


ENTRIES: tuple[Effect, ...] = (
    magnetizing_saturation,
    magnetic_hysteresis,
    remanence,
    leakage_saturation,
    rotor_skin_effect,
    iron_loss,
    shaft_motion,
    inductance_anisotropy,
    resistance_anisotropy,
)
