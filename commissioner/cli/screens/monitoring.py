"""A running motor on the terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console

from commissioner.cli.screens.screen import SENTENCE, err, out, quantity, table, text
from commissioner.monitor.chain import Observation, Refused
from commissioner.monitor.intake.findings import miswired
from commissioner.monitor.trend.trend import Verdict
from commissioner.records import RPM, in_words
from commissioner.report.sheet.numbers import half_width

SHOWN = (
    ("R_s", "stator_resistance_ohm", 1, "Ω"),
    ("R_R", "rotor_resistance_ohm", 1, "Ω"),
    ("L_σ", "leakage_inductance_h", 1e3, "mH"),
    ("L_M", "magnetizing_inductance_h", 1e3, "mH"),
)


def show_refused(seen: Refused, document: Mapping[str, Any]) -> None:
    """What the terminals show all the same."""
    _states(document, err)
    for finding in seen.findings:
        if not finding.stops:
            err.print(f"[dim]{finding.kind}[/] {text(finding.what, SENTENCE)}")
    f = seen.audited.fundamental
    if f is not None:
        err.print(
            f"[dim]what the terminals show all the same[/] {f.frequency_hz:.4g} Hz, {abs(f.voltage_v) / 2**0.5:.4g} V a phase "
            f"({f.voltage_unbalance:.2%} negative sequence), {abs(f.current_a) / 2**0.5:.4g} A ({f.current_unbalance:.2%}), "
            f"{f.power_w:.4g} W, {f.reactive_var:.4g} var"
        )


def show_partial(document: Mapping[str, Any]) -> None:
    """What could be had of partial data, what modulates the current, and what is withheld with its reason."""
    _states(document, out)
    rows = []
    for label, key, scale, unit in (
        ("mean speed", "mean_speed_rad_per_s", RPM, "1/min"),
        ("mean torque", "mean_torque_nm", 1.0, "N m"),
    ):
        if document[key] is not None:
            rows.append((label, quantity(document[key]["value"] * scale, document[key]["std"] * scale, unit)))
    rows += _beside(document)
    for name, value in document["indicators"].items():
        said, unit = in_words(name)
        rows.append((said, f"{_indicated(value)} {unit}".rstrip()))
    rows += [("modulates the current", f"{line['frequency_hz']:.4f} Hz") for line in document["periods"]]
    out.print(table("A partial answer", ("", ""), rows))
    withheld: dict[str, list[str]] = {}
    for name, why in document["withheld"].items():
        withheld.setdefault(why, []).append(name.replace("_", " "))
    for why, names in withheld.items():
        out.print(f"[yellow]withheld[/] {', '.join(names)}: {text(why)}")
    for finding in document["audit"]["findings"]:
        out.print(f"[dim]{finding['kind']}[/] {text(finding['what'])}")
    if document["trend"] is not None:
        out.print(
            f"{document['trend']['sentence']}: {', '.join(in_words(name)[0] for name in document['trend']['alarms']) or 'no alarm'}"
        )


def _beside(document: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What the speed column beside it reads, and how far the terminals' answer is from it in its own standard deviations."""
    r = document["reference_speed"]
    if not r:
        return []
    said = f"{r['mean_speed_rad_per_s'] * RPM:.6g} 1/min"
    for what, of, name in (("ours", "mean_speed", ""), ("ripple", "ripple", " of its rms")):
        if f"{of}_error_in_std" in r:
            off = f"{abs(r[f'{of}_error_in_std']):.2g} standard deviations ({abs(r[f'{of}_relative_error']):.2g}{name})"
            said += f"; {what} off by {off}"
    return [("speed column (not used)", said)]


def _indicated(value: float | bool | Mapping[str, float]) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, Mapping):
        return f"{value['level_db']:.3g} dB at ± {value['offset_hz']:.4g} Hz"
    return f"{value:.5g}"


def _states(document: Mapping[str, Any], where: Console) -> None:
    """The recording's stretches, where there is more than one."""
    stretches = document.get("states", [])
    if len(stretches) < 2:
        return
    rows = []
    for s in stretches:
        own = s.get("withheld", "")
        if "mean_torque_nm" in s:
            speed, torque = s["mean_speed_rad_per_s"], s["mean_torque_nm"]
            own = f"{speed['value'] * RPM:.6g} 1/min, {torque['value']:.4g} N m ± {half_width(torque['std']):.2g}"
        if s["used"] and where is out:
            own = "the answer below"
        rows.append((s["state"], f"{s['start_s']:.3g} ... {s['end_s']:.3g} s", f"{s['current_a']:.3g} A", own))
    where.print(table("", ("state", "from, to", "current", ""), rows))


def show(seen: Observation, document: Mapping[str, Any], verdict: Verdict | None) -> None:
    """The human view: what turns how fast against what, how sure, and what was put right."""
    _states(document, out)
    wiring = miswired(seen.findings)
    for finding in wiring:
        out.print(f"[bold yellow]check the probes:[/] {text(finding.what, SENTENCE)} (put right here)")
    out.print(table("", ("", "± is 95 %"), _shaft(seen, document["waveforms"]) + _beside(document)))
    _load_periods(seen)
    _motor(seen, document["parameters"])
    out.print(document["cannot_be_fixed"]["sentence"])
    for finding in seen.findings:
        if (finding not in wiring and finding.kind == "corrected") or (
            finding.kind == "note" and finding.code != "frequency_wander"
        ):
            out.print(f"[yellow]{finding.kind}[/] {text(finding.what, SENTENCE)}")
    if verdict is not None:
        colour = "red" if verdict.names else "green"
        out.print(
            f"[{colour}]{verdict.sentence}[/]"
            + (": " + ", ".join(in_words(name)[0] for name in verdict.names) if verdict.names else "")
        )
    for name, path in document.get("files", {}).items():
        out.print(f"[dim]{name.replace('_', ' '):<22}[/]{text(path)}", soft_wrap=True)


def _shaft(seen: Observation, waveforms: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Speed and torque, mean and over the period, and how well the current is simulated."""
    speed, load = seen.period.speed_rad_per_s, seen.period.load_torque_nm
    rows = [
        ("mean speed", quantity(seen.mean_speed_rad_per_s * RPM, seen.mean_speed_std * RPM, "1/min")),
        ("mean torque", quantity(seen.mean_torque_nm, seen.mean_torque_std, "N m")),
        (
            "speed within the period",
            f"{float(speed.max() - speed.min()) * RPM:.3g} 1/min peak to peak, "
            f"each point ± {half_width(waveforms['speed_rms_std_rad_per_s'], RPM):.2g}",
        ),
    ]
    said = waveforms["load_torque"]
    if load is not None:
        said = f"{load.min():.3g} ... {load.max():.3g} N m, each point ± {half_width(said['rms_std_nm']):.2g}"
    rows.append(("load torque", said))
    if seen.inertia_kg_m2 is not None:
        rows.append(("inertia used", f"{seen.inertia_kg_m2:.3g} kg m²; load torque scales with it"))
    rows.append(
        ("measured current", f"simulated to {seen.proof.relative_rms:.1%} rms (mains harmonics and noise included)")
    )
    return rows


def _load_periods(seen: Observation) -> None:
    rows = [
        (
            p.name,
            quantity(p.frequency_hz, p.frequency_std_hz, ""),
            f"{p.ratio_to_shaft:.4f}",
            f"{p.speed_ripple_rad_per_s * RPM:.3g} 1/min rms",
            p.follows,
        )
        for p in seen.load_periods
    ]
    out.print(table("Periods", ("what", "Hz", "of the shaft", "speed ripple", "varies with"), rows, right=(1, 2, 3)))


def _motor(seen: Observation, parameters: Mapping[str, Any]) -> None:
    """The four parameters, per phase."""
    rows = [
        (short, quantity(parameters[key]["value"] * scale, parameters[key]["std"] * scale, unit))
        for short, key, scale, unit in SHOWN
    ]
    out.print(f"[bold]Motor[/] (inverse Γ; start: {text(seen.start.origin)})")
    out.print(table("", ("", "± is 95 %"), rows))
