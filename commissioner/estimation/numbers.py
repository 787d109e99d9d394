"""The numbers of the machine and of what may be added to it: their places in the kernel's array, start values, coordinates.

Additions are relative, so that 0 is none and 1 is large: conductances of rated current over rated phase peak, fluxes of rated
flux, torques of rated torque. Numbers that must stay positive are fitted as logarithms.
"""

from __future__ import annotations

from dataclasses import dataclass

NAMES = (
    "stator_resistance", "rotor_resistance", "leakage_inductance", "magnetizing_inductance",
    "stator_saturation_1", "stator_saturation_2", "stator_saturation_3",
    "rotor_saturation_1", "rotor_saturation_2", "rotor_saturation_3",
    "gap_saturation_1", "gap_saturation_2", "gap_saturation_3", "leakage_split",
    "leakage_softness", "rotor_leakage_softness", "leakage_bend", "leakage_knee", "bar_resistance", "bar_corner", "iron_conductance", "stator_heat", "rotor_heat",
    "cage_asymmetry_re", "cage_asymmetry_im",
    "loop_conductance_u", "loop_susceptance_u", "loop_conductance_v", "loop_susceptance_v", "loop_conductance_w", "loop_susceptance_w",
    "loop_conductance_uv", "loop_susceptance_uv", "loop_conductance_vw", "loop_susceptance_vw", "loop_conductance_wu", "loop_susceptance_wu",
    "line_re", "line_im", "dead_voltage", "dead_knee", "voltage_gain_re", "voltage_gain_im", "voltage_offset_re", "voltage_offset_im",
    "speed_gain", "speed_lag", "speed_ripple_cos", "speed_ripple_sin", "delay", "current_gain_v", "current_gain_w",
    "current_offset_u", "current_offset_v", "current_offset_w", "current_pair_u", "current_pair_v", "current_pair_w",
    "inertia", "load_constant", "load_linear", "load_fan", "load_breakaway", "load_ripple_cos", "load_ripple_sin", "load_ripple_cos_2", "load_ripple_sin_2",
    "load_swing_cos", "load_swing_sin", "load_swing_turns",
)  # fmt: skip
AT = {name: k for k, name in enumerate(NAMES)}
COUNT = len(NAMES)
FOUR = NAMES[:4]
LOGARITHMIC = frozenset(
    AT[n]
    for n in (
        "stator_resistance", "rotor_resistance", "leakage_inductance", "magnetizing_inductance", "leakage_knee", "bar_corner",
        "dead_knee", "inertia", "leakage_split",
    )
)  # fmt: skip
OF_ANGLE = frozenset(
    AT[n]
    for n in NAMES
    if n.startswith(("speed_ripple", "load_ripple_", "load_swing_cos", "load_swing_sin", "cage_asymmetry"))
)
"""Numbers that are told from the shaft's angle, which is any at a window's first sample: each further window has its own."""
SHAPES = frozenset(
    AT[n] for n in ("leakage_bend", "leakage_knee", "leakage_split", "bar_corner", "dead_knee", "load_swing_turns")
)
"""Numbers that shape the law of another one, weakly determined beside it."""
DEFAULTS = {"leakage_split": 1.0, "leakage_knee": 3.0, "bar_corner": 138.0, "dead_knee": 0.02, "inertia": 0.01}
"""Leakage of the stator over that of the rotor; leakage flux of so many times rated current (from 2 on, the fit of knee and bend ended in a wrong valley); corner of the bars in rad/s;
of rated peak current; kg m^2."""


@dataclass(frozen=True)
class Scales:
    """What the additions are relative to: rated peak current, phase peak voltage, frequency, torque, and the pole pairs. `is_held`: the voltage
    stays from a sample to the next."""

    current_a: float
    voltage_v: float
    frequency_rad_per_s: float
    torque_nm: float
    pole_pairs: int
    is_held: bool = False

    def as_tuple(self) -> tuple[float, ...]:
        """As the kernel takes them."""
        return (
            self.current_a,
            self.voltage_v,
            self.frequency_rad_per_s,
            self.torque_nm,
            float(self.pole_pairs),
            float(self.is_held),
        )
