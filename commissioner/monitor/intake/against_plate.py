"""Do the currents of a running motor belong to its plate? Current and power at the measured voltage, frequency and slip."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

from commissioner.monitor.intake.findings import Audited, Finding, miswired
from commissioner.motor.nameplate import Nameplate, plate_doubt
from commissioner.motor.plate_match import Contradiction, OperatingPoint, contradiction, disagreement, doubt
from commissioner.motor.running import from_nameplate, slip_at_lag
from commissioner.records import ReadingNote, RunningRecording

RESOLVED = 0.25
"""Of a period of the recording's length: lines nearer to each other than that pull each other, a start's last transient does as well.
Without it 110 kW and 200 kW motors at a tenth of their load, 3 s long, were refused as of half the plate's current: their shaft lines, 0.05 ...
0.2 of a period beside the supply's, were seen by up to 0.15 off."""

VOLTS_PER_HERTZ = (0.1, 4.0)
"""Of the plate's: motors at no load are run at a third, starts at a few hertz at twice."""


def against_plate(audited: Audited, shaft_hz: float | None, plate: Nameplate) -> Contradiction | None:
    """The contradiction between what was measured at the shaft's slip and the plate; None where there is none to be seen.

    Where the shaft was not seen (None), at the slip at which the plate's motor has this power factor: a common factor of the
    currents leaves that as it is.
    """
    point = _point(audited, shaft_hz, plate)
    return None if point is None else contradiction(point, plate)


def unresolved_shaft(audited: Audited, shaft_hz: float | None, length_s: float, plate: Nameplate) -> Finding | None:
    """Of a contradiction that rests on the slip alone: where the slip of the power factor, which a common factor of the currents leaves as it
    is, makes the plate's motor of them, and the two shaft lines are one within this length, no scale is wrong: the slip is. None elsewhere."""
    taken, by_lag = _point(audited, shaft_hz, plate), _point(audited, None, plate)
    if shaft_hz is None or taken is None or by_lag is None or contradiction(by_lag, plate) is not None:
        return None
    expected_hz = by_lag.frequency_hz * (1.0 - by_lag.slip) / plate.pole_pairs
    apart = abs(shaft_hz - expected_hz) * length_s
    if apart > RESOLVED:
        return None
    return Finding(
        "no_shaft_line", "refused",
        f"the shaft's line, seen at {shaft_hz:.5g} Hz, lies too near the supply's for {length_s:.2f} s: current and power factor are those of the "
        f"plate's motor at {expected_hz:.5g} Hz",
        shaft_hz, f"{RESOLVED:g} of a period of the recording's length apart", "record 30-60 s at steady load, or at more load",
    )  # fmt: skip


def unscaled_order_deg(audited: Audited, shaft_hz: float | None, plate: Nameplate) -> float | None:
    """The lag in the order that one factor of the currents explains best, where another one was taken that the columns do not name: it
    was taken by the currents' size, which is in doubt."""
    taken = _point(audited, shaft_hz, plate)
    if taken is None or not audited.others_deg or not miswired(audited.findings):
        return None
    apparent = math.hypot(taken.power_w, taken.reactive_var)

    def unlike(lag_deg: float) -> float:
        power = cmath.rect(apparent, math.radians(lag_deg))
        return disagreement(replace(taken, power_w=power.real, reactive_var=power.imag), plate)

    best = min(audited.others_deg, key=unlike)
    return best if unlike(best) < disagreement(taken, plate) else None


def doubt_of(audited: Audited, shaft_hz: float | None, plate: Nameplate) -> Finding | None:
    """A note of a factor that lies between the usual and a contradiction, and of a plate that is unusual in itself."""
    point = _point(audited, shaft_hz, plate)
    said = "; ".join(s for s in (plate_doubt(plate), "" if point is None else doubt(point, plate)) if s)
    return Finding("plate_doubt", "note", said) if said else None


def _point(audited: Audited, shaft_hz: float | None, plate: Nameplate) -> OperatingPoint | None:
    """What was measured, at the shaft's slip or that of the power factor; None where no slip of a machine that works is seen."""
    seen = audited.fundamental
    if seen is None or seen.frequency_hz <= 0.0:
        return None
    if shaft_hz is None:
        lag = math.atan2(seen.reactive_var, seen.power_w)
        slip = slip_at_lag(from_nameplate(plate), 2.0 * math.pi * seen.frequency_hz, lag)
    else:
        slip = 1.0 - plate.pole_pairs * shaft_hz / seen.frequency_hz
    if slip == 0.0 or abs(slip) >= 0.5:
        return None
    return OperatingPoint(
        abs(seen.voltage_v) / math.sqrt(2.0), seen.frequency_hz, slip, abs(seen.current_a) / math.sqrt(2.0), seen.power_w,
        seen.reactive_var,
    )  # fmt: skip


def volts_per_hertz(audited: Audited, plate: Nameplate) -> Finding | None:
    """Of a recording that shows nothing turning: a voltage that no motor of this plate is run at; None for any other."""
    seen = audited.fundamental
    if seen is None:
        return None
    line_v = abs(seen.voltage_v) * math.sqrt(1.5)
    ratio = line_v / seen.frequency_hz / (plate.rated_voltage_v / plate.rated_frequency_hz)
    if VOLTS_PER_HERTZ[0] <= ratio <= VOLTS_PER_HERTZ[1]:
        return None
    return Finding(
        "plate_contradiction", "refused",
        f"the data do not belong to this plate: {line_v:.4g} V between lines at {seen.frequency_hz:.4g} Hz are {ratio:.3g} times "
        "its volts per hertz, and nothing is seen to turn", line_v,
        plate.rated_voltage_v * seen.frequency_hz / plate.rated_frequency_hz,
        "check the voltages' unit, probes and scale, and that the plate is this motor's",
    )  # fmt: skip


def of_contradiction(against: Contradiction, *, stops: bool) -> Finding:
    """As a finding: a refusal, or a note where the data are trusted."""
    return Finding(
        "plate_contradiction", "refused" if stops else "note",
        against.what + ("" if stops else ": the data were trusted, as told"), against.value, against.limit, against.remedy,
    )  # fmt: skip


def over_currents(recording: RunningRecording, factor: float) -> RunningRecording:
    """The recording with its currents divided by a factor, and a note of it."""
    u, v, w = recording.currents_a
    note = ReadingNote(
        "currents_by_plate", f"the currents were divided by {factor:.4g}: the plate was to be trusted, as told"
    )
    return replace(recording, currents_a=(u / factor, v / factor, w / factor), notes=(*recording.notes, note))
