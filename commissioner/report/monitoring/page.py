"""The page of a monitored recording: what the shaft does within a turn, how sure that is, and against which past."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from commissioner.monitor.chain import Observation
from commissioner.monitor.intake.findings import miswired
from commissioner.monitor.result import why_no_load_torque
from commissioner.monitor.trend.indicators import Indicator, Pulses
from commissioner.monitor.trend.trend import FALSE_ALARM, History, Verdict
from commissioner.motor.quantities import FIVE
from commissioner.records import RPM, in_words
from commissioner.report import band
from commissioner.report.monitoring import figures
from commissioner.report.page import Page, Section, Table, Tone, picture
from commissioner.report.sheet.numbers import digits, half_width, interval, like, percent, with_interval

_WIRING = {"crossed_channels": "channels are crossed", "polarity": "a channel is inverted"}


def page_of(
    seen: Observation,
    pulses: Pulses | None,
    indicators: Sequence[Indicator],
    verdict: Verdict | None,
    history: History | None,
    document: Mapping[str, Any],
    name: str,
) -> Page:
    """One self-contained page; all figures inline."""
    tone: Tone = "bad" if verdict is not None and verdict.names else "warn" if miswired(seen.findings) else "good"
    return Page(
        title=f"Running motor: {name}",
        headline=_headline(seen, verdict),
        tone=tone,
        facts=_facts(seen, verdict),
        sections=[
            *_states(document),
            _shaft(seen),
            _proof(seen, document),
            _spectrum(seen),
            *([_pulses(pulses)] if pulses else []),
            *([_trend(verdict, history, indicators)] if verdict and history else []),
            _motor(seen, document),
            _audit(seen),
        ],
        footer="Quantities are SI, per phase of the star equivalent; every ± is a 95 % interval. Method: C. J. Schantz, "
        "S. B. Leeb, Self-Sensing Induction Motors for Condition Monitoring.",
    )


def _headline(seen: Observation, verdict: Verdict | None) -> str:
    period = seen.period
    swing = digits(float(period.speed_rad_per_s.max() - period.speed_rad_per_s.min()) * RPM, 3)
    text = f"{seen.mean_speed_rad_per_s * RPM:.2f} 1/min, moving by {swing} 1/min peak to peak within the period, at {digits(seen.mean_torque_nm, 3)} N m."
    if wiring := miswired(seen.findings):
        text = f"Check the probes: {' and '.join(_WIRING[f.code] for f in wiring)} (put right here, see the last section). {text}"
    if verdict is None:
        return text
    return f"{text} Against its past: {verdict.sentence}{' (' + ', '.join(in_words(n)[0] for n in verdict.names) + ')' if verdict.names else ''}."


def _facts(seen: Observation, verdict: Verdict | None) -> list[tuple[str, str]]:
    return [
        ("mean speed", f"{with_interval(seen.mean_speed_rad_per_s * RPM, half_width(seen.mean_speed_std, RPM))} 1/min"),
        (
            "mean torque",
            f"{with_interval(seen.mean_torque_nm, half_width(seen.mean_torque_std))} N m "
            f"(± {digits(half_width(seen.mean_torque_sensor_std), 2)} of it by sensor gain)",
        ),
        ("slip", f"{100 * seen.slip:.3f} %"),
        ("supply", f"{seen.lines.supply_rad_per_s / 6.283185307179586:.4f} Hz"),
        ("measured current, simulated to", f"{percent(seen.proof.relative_rms)} rms"),
        *(
            [("inertia used; load torque scales with it", f"{seen.inertia_kg_m2:.3g} kg m²")]
            if seen.inertia_kg_m2 is not None
            else []
        ),
        *([("against its past", "no past given (--baseline FILE --learn)")] if verdict is None else []),
    ]


def _states(document: Mapping[str, Any]) -> list[Section]:
    """The band of states, where there is more than one."""
    stretches = document.get("states", [])
    if len(stretches) < 2:
        return []
    rows = [(s["state"], f"{s['start_s']:.3g} ... {s['end_s']:.3g} s", "yes" if s["used"] else "no") for s in stretches]
    return [
        Section(
            "What the motor did",
            picture(
                band.strip(stretches),
                "The states of the recording, by its terminals. The answer is of the stretch that was used.",
            ),
            Table(("state", "from, to", "used"), rows),
        )
    ]


def _shaft(seen: Observation) -> Section:
    known = "" if seen.period.load_torque_nm is not None else f" Load torque: {why_no_load_torque(seen)}."
    return Section(
        "What the shaft does within the period",
        picture(
            figures.over_angle(seen),
            "Speed, electromagnetic and load torque over shaft angle with 95 % intervals." + known,
        ),
        picture(
            figures.polar(seen),
            "The same around the shaft: distance from the centre is load torque (left) and speed (right).",
        ),
        Table(
            (
                "what repeats",
                "frequency / Hz",
                "of the shaft",
                "speed ripple rms / (1/min)",
                "harmonics",
                "periods averaged",
                "varies with",
            ),
            [
                (
                    p.name,
                    with_interval(p.frequency_hz, half_width(p.frequency_std_hz)),
                    f"{p.ratio_to_shaft:.4f}",
                    f"{p.speed_ripple_rad_per_s * RPM:.3g}",
                    str(p.harmonics),
                    f"{p.periods_averaged:.0f}",
                    p.follows,
                )
                for p in seen.load_periods
            ],
        ),
    )


def _proof(seen: Observation, document: Mapping[str, Any]) -> Section:
    parts: list[Any] = [
        picture(
            figures.resimulation(seen),
            f"Measured current, and the model's current when the measured voltage drives it at the estimated speed: they differ by "
            f"{percent(seen.proof.relative_rms)} rms, noise and mains harmonics included.",
        )
    ]
    if document.get("reference_speed"):
        r = document["reference_speed"]
        parts.append(
            f"Against the speed column of the recording (never an input): mean off by {r['mean_speed_relative_error']:+.4%}, "
            f"ripple off by {percent(r['ripple_relative_error'])} of its rms."
        )
    return Section("Check: the current simulated at this speed against the measured one", *parts)


def _spectrum(seen: Observation) -> Section:
    return Section(
        "What the currents show",
        picture(
            figures.spectrum(seen),
            "Side bands of the current in the supply's frame, over their local floor, with the lines named. "
            "Below: what is left after all named combs and mains harmonics are taken out.",
        ),
    )


def _pulses(pulses: Pulses) -> Section:
    return Section(
        "Torque pulses laid over each other",
        picture(
            figures.superimposed(pulses),
            f"{pulses.per_turn} pulses a turn, normalised. Area between them: "
            f"{with_interval(pulses.dissimilarity.value, half_width(pulses.dissimilarity.std))} % of a pulse; difference of their "
            f"areas: {with_interval(pulses.area_difference.value, half_width(pulses.area_difference.std))} %.",
        ),
    )


def _trend(verdict: Verdict, history: History, indicators: Sequence[Indicator]) -> Section:
    rows = [
        (
            " / ".join(filter(None, in_words(w.name))),
            like(w.value, half_width(w.healthy_std)),
            with_interval(w.healthy_mean, half_width(w.healthy_std)),
            f"{w.distance:+.1f}",
            f"{w.threshold:.1f}",
        )
        for w in verdict.watched
    ]
    tones: list[Tone] = ["bad" if w.alarms else "good" for w in verdict.watched]
    note = (
        f"{verdict.compared_with} healthy recordings at this operating point, {verdict.other_operating_points} at others. "
        f"{verdict.left_out_alarms} of them would alarm against the rest; the threshold is set for one false alarm in "
        f"{1 / FALSE_ALARM:,.0f} recordings and indicator."
    )
    return Section(
        "Against this machine's past",
        picture(
            figures.trend(history, indicators, verdict),
            "Healthy recordings, those judged since, and this one (last point), with the 95 % interval of a recording. "
            "Shaded: the range outside which an indicator alarms.",
        ),
        Table(("indicator", "now", "healthy", "standard deviations away", "threshold"), rows, tones, note)
        if rows
        else note,
    )


def _motor(seen: Observation, document: Mapping[str, Any]) -> Section:
    parameters = document["parameters"]
    return Section(
        "The motor as it runs now",
        Table(
            ("parameter (inverse-Gamma circuit)", "value", "95 % interval"),
            [
                (q.name, f"{shown} {q.unit}", f"± {half} {q.unit}")
                for q in FIVE
                for found in [parameters[q.field]]
                for shown, half in [interval(q.factor * found["value"], half_width(found["std"], q.factor))]
            ],
            caption=f"Fitted to this recording, started from: {seen.start.origin}.",
        ),
        document["cannot_be_fixed"]["sentence"],
    )


def _audit(seen: Observation) -> Section:
    tones: list[Tone] = ["warn" if f.kind == "corrected" else "plain" for f in seen.findings]
    trust = seen.audited.sensors
    channels = "; ".join(f"{phase}: {channel}" for phase, channel in seen.audited.channel_map.items())
    return Section(
        "What was found in the recording",
        Table(("", "finding"), [(f.kind, f.what) for f in seen.findings], tones),
        f"Channels as used: {channels}.",
        f"Sensors are trusted to ± {digits(half_width(trust.gain_std, 100.0), 2)} % in gain. The currents were found to lag the voltages by "
        f"{with_interval(1e6 * seen.fitted.delay_s, half_width(seen.fitted.delay_std_s, 1e6))} µs of sensor delay (taken before: 0 ± "
        f"{digits(half_width(trust.skew_std_s, 1e6), 2)} µs). Beyond what was corrected, channels may differ by {trust.asymmetry:.1%}.",
    )
