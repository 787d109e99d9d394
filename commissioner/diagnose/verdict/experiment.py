"""What to record next: the test that splits a tie or finds an unnamed rest, as steps a technician can follow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from commissioner.diagnose.catalogue import CATALOGUE
from commissioner.diagnose.intake.record import Facts, Record

COMMAND = "commissioner diagnose first.csv second.csv --out compared"
SAME = "Leave everything else as it was: axis, level, and the sampling rate of the recording."
KEEPS = "No. R_s, R_R, L_sigma and L_M stay as they are; only the names become surer."
HALF, HIGH, PLENTY_SIGMAS = 0.5, 0.4, 10.0

DECIDES: Mapping[str, str] = {
    "dead_time": "Repeat one test at half the switching frequency.",
    "device_drop": "Repeat one test at half the switching frequency.",
    "dc_link_sag": "Record the DC-link voltage with the currents (column dc_link_v), or repeat one test at half the level.",
    "dc_link_ripple": "Record the DC-link voltage with the currents (column dc_link_v).",
    "cable_capacitance": "Repeat one test with a much shorter cable, or add a tone near 0.4 of the sampling rate.",
    "magnetizing_saturation": "Repeat the test of the lowest frequency at half the level.",
    "magnetic_hysteresis": "Repeat the test of the lowest frequency at half and at a quarter of the level.",
    "remanence": "Wait ten seconds with the inverter off before the test, or begin it with the opposite sign.",
    "leakage_saturation": "Repeat one test at half the level, and one with a DC current added.",
    "rotor_skin_effect": "Add tones between 20 Hz and 1 kHz.",
    "iron_loss": "Add tones above 1 kHz, or run a no-load test and give its points to `commissioner diagnose`.",
    "stator_heating": "Repeat the first test last, at once and again after a pause of ten minutes.",
    "rotor_heating": "Put a test with DC current alone between two equal tests.",
    "shaft_motion": "Block the shaft and repeat one test.",
    "inductance_anisotropy": "Record the axes 0, 60 and 120 degrees, and the first of them again.",
    "resistance_anisotropy": "Record the axes 0, 60 and 120 degrees, and the first of them again; compare with an ohmmeter.",
    "sampling_delay": "Add a tone near 0.4 of the sampling rate.",
    "sensor_lag": "Add a tone near 0.4 of the sampling rate.",
    "sensor_offset": "Read the three currents with the inverter off: what they show then is the offset.",
    "sensor_drift": "Read the three currents with the inverter off, before the test and after it.",
    "sensor_gain_mismatch": "Send one current through all three sensors in series, or record the axes 0, 60 and 120 degrees.",
    "sensor_nonlinearity": "Compare the sensors with a good meter at five DC currents of both signs.",
    "quantization": "Repeat with a smaller measuring range.",
    "clipping": "Repeat at a lower level or with a larger measuring range.",
    "mains_pickup": "Record one second with the inverter off: hum stays.",
    "clock_drift": "Record current and voltage with one instrument, or make one test ten times as long.",
    "lost_samples": "Let the logger number its samples.",
}
"""What settles whether the name is right, in one sentence."""


LINK_IS_RECORDED: Mapping[str, str] = {
    "dc_link_sag": "Repeat one test at half the level: a sag falls to a quarter.",
    "dc_link_ripple": "Look at the recorded dc_link_v: the ripple must be in it.",
}


def what_decides(name: str, record: Record) -> str:
    """What settles a name in these data: nobody is asked to record what is recorded."""
    is_recorded = all(s.link_swing is not None for s in record.segments)
    return LINK_IS_RECORDED[name] if is_recorded and name in LINK_IS_RECORDED else DECIDES.get(name, "")


@dataclass(frozen=True)
class Procedure:
    """`steps` in order; the last command reads the old and the new file together."""

    steps: tuple[str, ...]
    command: str = COMMAND
    changes_values: str = KEEPS


def next_experiment(verdict: str, causes: Sequence[Any], record: Record) -> Mapping[str, object] | None:
    """The most useful next test, or None where nothing is open."""
    if verdict == "unexplained":
        how = Procedure(
            (
                "Repeat every test at half the level. " + SAME,
                "Block the shaft and repeat one test at the old level.",
                "Read both recordings together:",
            ),
            changes_values="Perhaps. Until the unknown is found, trust none of the values further than the error shown here.",
        )
        return _plan(["unknown"], "repeat every segment at half amplitude and one with the shaft blocked", how, None)
    tied = [c for c in causes if c.equivalent]
    if tied:
        cause = max(tied, key=lambda c: c.strength_sigma)
        names = [cause.name, *cause.equivalent]
        is_legs = {"dead_time", "device_drop"} <= set(names)
        return _plan(
            names,
            CATALOGUE[cause.name].split_by,
            procedure(names, record.facts),
            _predicted(cause) if is_legs else None,
        )
    axes = {round(s.axis_deg % 180.0, 3) for s in record.segments}
    if len(axes) < 3:
        names = ["inductance_anisotropy", "sensor_gain_mismatch"]
        return _plan(names, "add axes 60 and 120 degrees", procedure(names, record.facts), None)
    return None


def procedure(names: Sequence[str], facts: Facts) -> Procedure:
    """How these causes are told apart; a pair without its own recipe gets what decides each of them."""
    recipe = RECIPES.get(frozenset(names))
    if recipe is not None:
        return recipe(facts)
    steps = tuple(dict.fromkeys(DECIDES[n] for n in names if n in DECIDES))
    return Procedure((*steps, SAME, "Read both recordings together:"))


def _legs(facts: Facts) -> Procedure:
    now = facts.switching_frequency_hz
    half = f"from {now:g} to {HALF * now:g} Hz" if now else "to half"
    written = f"{HALF * now:g}" if now else "the new value in Hz"
    return Procedure(
        (
            f"Set the drive's switching (carrier) frequency {half}. If it cannot be set, change the DC-link voltage by a fifth instead.",
            "Record one of the tests again. " + SAME,
            f"Each file must say its own at the top: the new one `# switching_frequency_hz: {written}` (or `# dc_link_v: ...`).",
            "Set the drive back.",
            "Read both recordings together:",
        ),
        changes_values="No. It only splits the voltage between dead time and device drop; worth it if you want to set "
        "the drive's dead-time compensation by number.",
    )


def _late(facts: Facts) -> Procedure:
    return Procedure(
        (
            f"Add one tone near {HIGH / facts.sample_period_s:.0f} Hz (0.4 of the sampling rate) to the test signal.",
            "Record one of the tests again. " + SAME,
            "Read both recordings together:",
        ),
        changes_values="Hardly. The motor values follow from the delay in all, and that is known.",
    )


def _axes(facts: Facts) -> Procedure:
    return Procedure(
        (
            "Record the same test on the axes 60 and 120 degrees too, then on the first axis once more. " + SAME,
            "Read both recordings together:",
        ),
        changes_values="Perhaps by the difference between the axes, mostly below 1 %.",
    )


def _off(facts: Facts) -> Procedure:
    return Procedure(
        (
            "Record the three currents for some seconds with the inverter off, before the test and after it.",
            "What they show is the offset; what changes between the two is the drift. Take it off the currents.",
            "Read the corrected recording:",
        ),
        command="commissioner diagnose corrected.csv --out compared",
    )


def _skin(facts: Facts) -> Procedure:
    return Procedure(
        (
            "Uncouple the motor and run it at no load, rated frequency, at five to eight voltages from 30 to 110 % of rated.",
            "Note voltage, current and power of each in a table. What the core loses there is iron loss, not skin effect.",
            "Read the table:",
        ),
        command="commissioner diagnose no_load.csv --out no_load",
        changes_values="Hardly. R_R at the slip of a running motor is the value at low frequency, and that stays.",
    )


RECIPES = {
    frozenset({"dead_time", "device_drop"}): _legs,
    frozenset({"sampling_delay", "sensor_lag"}): _late,
    frozenset({"inductance_anisotropy", "sensor_gain_mismatch"}): _axes,
    frozenset({"resistance_anisotropy", "sensor_gain_mismatch"}): _axes,
    frozenset({"inductance_anisotropy", "resistance_anisotropy"}): _axes,
    frozenset({"sensor_offset", "sensor_drift"}): _off,
    frozenset({"iron_loss", "rotor_skin_effect"}): _skin,
}


def _plan(names: Sequence[str], do: str, how: Procedure, sigma: float | None) -> Mapping[str, object]:
    return {
        "splits": list(names),
        "do": do,
        "predicted_sigma": sigma,
        "steps": list(how.steps),
        "command": how.command,
        "repeats": _repeats(sigma),
        "changes_values": how.changes_values,
    }


def _repeats(sigma: float | None) -> int:
    """Recordings that make the difference PLENTY_SIGMAS times its own uncertainty; two where nothing is predicted."""
    return 2 if sigma is None else min(max(int(-(-((PLENTY_SIGMAS / max(sigma, 1e-3)) ** 2) // 1)), 1), 20)


def _predicted(cause: Any) -> float:
    """Halving the switching frequency halves a dead time's voltage: half its present strength in standard deviations."""
    return float(HALF * cause.delta_chi2**0.5)
