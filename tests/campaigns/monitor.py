"""Blind campaigns of the self-sensing half: `python -m tests.campaigns.monitor accuracy|healthy|leaks [COUNT] [--machines M]`.

Machines are published ones (tests/data/motors) scattered by +-20 %, loads, mains and noise are drawn from the seed; the plate is
the machine's steady state in closed form. The answer is compared with what the simulated shaft truly did.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import decimate

from commissioner.monitor.chain import Observation, Refused, Wishes, observe
from commissioner.monitor.machine.fit import Start
from commissioner.motor.nameplate import Nameplate
from commissioner.motor.running import TCircuit
from commissioner.records import RunningRecording
from sim.physics.running import Played
from sim.recordings.running import CURRENTS, LINES, NAMEPLATE, PHASES, record, run

MOTORS = Path(__file__).parents[1] / "data" / "motors" / "motors.csv"
KINDS = ("compressor", "leak", "imbalance", "pump", "brake", "gear", "both")
MULTI = ("brake", "gear", "both")
CIRCUIT = (
    "stator_resistance_ohm",
    "rotor_resistance_ohm",
    "stator_leakage_h",
    "rotor_leakage_h",
    "magnetizing_inductance_h",
)


def machines() -> list[dict[str, str]]:
    """Rows below 30 kW with a T circuit that are meant for such studies."""
    with MOTORS.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return [r for r in rows if r["use_for_mc"] == "1" and 0.2 < float(r["P_kW"] or 0) < 30 and r["slip_calc"]]


def draw(seed: int, kind: str) -> dict[str, Any]:
    """A scenario: machine, mains, load of this kind, 30 s at 8 kHz with 1 % noise."""
    rng = np.random.default_rng([seed, 77])
    rows = machines()
    row = rows[int(rng.integers(len(rows)))]
    pairs, frequency = int(row["poles"]) // 2, float(row["f_Hz"])
    circuit = {
        "stator_resistance_ohm": float(row["Rs_ohm"]),
        "rotor_resistance_ohm": float(row["Rr_ohm"]),
        "stator_leakage_h": float(row["Lls_mH"]) / 1e3,
        "rotor_leakage_h": float(row["Llr_mH"]) / 1e3,
        "magnetizing_inductance_h": float(row["Lm_mH"]) / 1e3,
    }
    plate = _plate(circuit, float(row["P_kW"]) * 1e3, float(row["V_LL"]), frequency, pairs)
    speed = plate["rated_speed_rpm"] * np.pi / 30
    torque = plate["rated_power_w"] / speed
    inertia = 2 * rng.uniform(0.12, 0.4) * plate["rated_power_w"] / speed**2
    return {
        "kind": "running",
        "nameplate": plate,
        "machine": circuit
        | {
            "pole_pairs": pairs,
            "inertia_kg_m2": float(inertia),
            "rotor_slots": int(rng.integers(22, 56)),
            "slot_modulation": 0.002,
            "eccentricity": 0.0003,
            "scatter": 0.2,
        },
        "supply": {
            "voltage_v": plate["rated_voltage_v"],
            "frequency_hz": frequency,
            "frequency_spread_hz": 0.1,
            "unbalance": 0.03,
            "fifth": 0.02,
            "seventh": 0.02,
            "drift_hz": 0.05,
            "sag": 0.002,
        },
        "steady_load": {"constant_nm": float(0.1 * torque)},
        "loads": _loads(kind, float(torque), frequency / pairs, rng),
        "sensing": {"noise": 0.01, "bits": 16},
        "recording": {"duration_s": 30.0, "rate_hz": 8000.0},
    }


def _loads(kind: str, torque: float, synchronous_hz: float, rng: np.random.Generator) -> list[dict[str, Any]]:
    share = rng.uniform(0.4, 0.75)
    compressor = {
        "kind": "compressor",
        "mean_nm": share * torque,
        "leak_mm2": [0.0, 0.0],
        "pressure_ratio": float(rng.uniform(3, 6)),
    }
    imbalance = {
        "kind": "harmonics",
        "name": "imbalance",
        "mean_nm": share * torque,
        "amplitudes_nm": (torque * np.array([0.12, 0.05, 0.03])).tolist(),
        "phases_rad": rng.uniform(0, 6, 3).tolist(),
    }
    small = imbalance | {"amplitudes_nm": (torque * np.array([0.05, 0.02])).tolist(), "phases_rad": [0.3, 1.4]}
    frequencies = [1.9, 19.0, 70.8, float(rng.uniform(3, 60))]
    brake = {
        "kind": "brake",
        "frequency_hz": frequencies[int(rng.integers(4))],
        "amplitude_nm": 0.15 * torque,
        "edge": 0.2,
    }
    while abs(brake["frequency_hz"] / synchronous_hz - round(brake["frequency_hz"] / synchronous_hz)) < 0.07:
        brake["frequency_hz"] = float(rng.uniform(3, 60))
    gear = {
        "kind": "gear",
        "ratio": float(rng.choice([2.37, 3.618, 1.734, 4.41])),
        "mean_nm": share * torque,
        "amplitudes_nm": (torque * np.array([0.15, 0.08, 0.04])).tolist(),
        "phases_rad": rng.uniform(0, 6, 3).tolist(),
    }
    return {
        "compressor": [compressor],
        "leak": [compressor | {"leak_mm2": [float(rng.uniform(0.4, 2.5)), 0.0]}],
        "imbalance": [imbalance],
        "pump": [
            {
                "kind": "pump",
                "vanes": 3,
                "mean_nm": share * torque,
                "amplitude_nm": 0.3 * torque,
                "once_nm": 0.08 * torque,
            }
        ],
        "brake": [small | {"mean_nm": share * torque}, brake],
        "gear": [small | {"mean_nm": 0.0}, gear],
        "both": [compressor, brake],
    }[kind]


def _plate(circuit: dict[str, float], power: float, voltage: float, frequency: float, pairs: int) -> dict[str, Any]:
    """Rated current, speed and power factor of the T circuit at the slip that gives the rated shaft power (bisection)."""
    w = 2 * np.pi * frequency

    def at(slip: float) -> tuple[float, complex]:
        rotor = circuit["rotor_resistance_ohm"] / slip + 1j * w * circuit["rotor_leakage_h"]
        main = 1j * w * circuit["magnetizing_inductance_h"]
        z = circuit["stator_resistance_ohm"] + 1j * w * circuit["stator_leakage_h"] + main * rotor / (main + rotor)
        current = voltage / np.sqrt(3) / z
        inner = abs(current * main / (main + rotor)) ** 2
        return 3 * inner * circuit["rotor_resistance_ohm"] / slip * (1 - slip), current

    low, high = 1e-4, 0.15
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if at(middle)[0] < power else (low, middle)
    current = at(low)[1]
    return {
        "rated_power_w": power,
        "rated_voltage_v": voltage,
        "rated_frequency_hz": frequency,
        "rated_current_a": round(float(abs(current)), 2),
        "rated_speed_rpm": round(60 * frequency / pairs * (1 - low)),
        "power_factor": round(float(np.cos(np.angle(current))), 2),
        "pole_pairs": pairs,
        "connection": "star",
    }


def as_recording(columns: dict[str, Any], metadata: dict[str, Any]) -> RunningRecording:
    is_line = LINES[0] in columns
    i = tuple(columns[name] for name in CURRENTS)
    v = tuple(columns[name] for name in (LINES if is_line else PHASES))
    return RunningRecording(
        columns["time_s"],
        (i[0], i[1], i[2]),
        (v[0], v[1], v[2]),
        is_line,
        columns.get("speed_rad_per_s"),
        metadata["sample_period_s"],
        metadata,
    )


def as_plate(metadata: dict[str, Any]) -> Nameplate:
    return Nameplate(**{key: metadata[key] for key in NAMEPLATE}, inertia_kg_m2=metadata["inertia_kg_m2"])


def play(scenario: dict[str, Any], seed: int) -> tuple[Observation | Refused, dict[str, Any]]:
    columns, metadata, truth = record(scenario, seed)
    return observe(as_recording(columns, metadata), as_plate(metadata)), truth


def score(seen: Observation, played: Played, truth: dict[str, Any]) -> dict[str, float]:
    """Errors in per cent: mean speed and torque of their values; waveforms (rms, means removed) of their amplitude, which is
    half of peak to peak; beside it of the largest deviation from the mean, and of the rms. `*_z`: over the claimed std.

    The truth's waveform is what repeats with the loads: its least-squares lines on the true phases over the segment.
    """
    time = seen.frame.time_s[seen.part] + seen.audited.start_s
    inside = (played.time_s >= time[0]) & (played.time_s <= time[-1])
    out = {
        "speed": 100 * (seen.mean_speed_rad_per_s / truth["mean_speed_rad_per_s"] - 1),
        "torque": 100 * (seen.mean_torque_nm / played.electromagnetic_torque_nm[inside].mean() - 1),
    }
    load = seen.period.load_torque_nm
    out["speed_z"] = (seen.mean_speed_rad_per_s - truth["mean_speed_rad_per_s"]) / seen.mean_speed_std
    out["torque_z"] = out["torque"] / 100 * seen.mean_torque_nm / seen.mean_torque_std
    waveforms = [("ripple", played.speed_rad_per_s, seen.period.speed_rad_per_s)]
    stds = {"ripple": seen.period.speed_std, "load": seen.period.load_torque_std}
    if load is None:  # withheld: counted as outside every limit
        out |= dict.fromkeys(("load", "load_of_peak", "load_of_rms", "load_z"), float("nan"))
    else:
        waveforms.append(("load", played.load_torque_nm, load))
    for name, true, own in waveforms:
        expected = _periodic(true[inside], played.time_s[inside], played.angle_rad[inside], truth, seen)
        error = own - own.mean() - expected + expected.mean()
        rms = 100 * float(np.sqrt(np.mean(error**2)))
        out[name] = rms / float(0.5 * np.ptp(expected))
        out[f"{name}_of_peak"] = rms / float(np.abs(expected - expected.mean()).max())
        out[f"{name}_of_rms"] = rms / float(expected.std())
        claimed = stds[name]
        assert claimed is not None
        out[f"{name}_z"] = rms / 100 / float(np.sqrt(np.mean(claimed**2)))
    return out


def _periodic(
    true: np.ndarray, time_s: np.ndarray, angle: np.ndarray, truth: dict[str, Any], seen: Observation
) -> np.ndarray:
    """The load-periodic part of a true signal at the estimate's instants."""
    step = 4
    sampled = decimate(true, step, ftype="fir")
    t, a = time_s[::step], angle[::step]
    shaft = truth["mean_speed_rad_per_s"] / (2 * np.pi)
    phases, outputs = [a], [np.interp(seen.period.time_s, time_s, angle)]
    for one in truth["loads"]:
        ratio = one["frequency_hz"] / shaft
        if not one["locked_to_shaft"]:
            phases.append(2 * np.pi * one["frequency_hz"] * t)
            outputs.append(2 * np.pi * one["frequency_hz"] * seen.period.time_s)
        elif abs(ratio - 1) > 1e-3:
            phases.append(ratio * a)
            outputs.append(ratio * outputs[0])
    orders = 24 if len(phases) == 1 else 16
    matrix = np.concatenate(
        [np.ones((t.size, 1))]
        + [f(h * p)[:, None] for p in phases for h in range(1, orders + 1) for f in (np.cos, np.sin)],
        axis=1,
    )
    weighted = matrix * np.hanning(t.size)[:, None]
    gram = weighted.T @ matrix
    lines = np.linalg.solve(gram + 1e-10 * gram[0, 0] * np.eye(gram.shape[0]), weighted.T @ sampled)
    target = np.concatenate(
        [np.ones((seen.period.time_s.size, 1))]
        + [f(h * p)[:, None] for p in outputs for h in range(1, orders + 1) for f in (np.cos, np.sin)],
        axis=1,
    )
    return np.asarray(target @ lines)


def periods_found(seen: Observation, truth: dict[str, Any]) -> bool:
    """The shaft within 0.1 %, every other load within 0.05 Hz, and nothing else."""
    shaft = truth["mean_speed_rad_per_s"] / (2 * np.pi)
    wanted = sorted({round(p["frequency_hz"], 6) for p in truth["loads"] if abs(p["frequency_hz"] / shaft - 1) > 1e-3})
    got = sorted(p.frequency_hz for p in seen.load_periods[1:])
    near = len(wanted) == len(got) and all(abs(a - b) < 0.05 for a, b in zip(wanted, got, strict=True))
    return near and abs(seen.load_periods[0].frequency_hz / shaft - 1) < 1e-3


def accuracy(count: int, first: int = 0) -> list[dict[str, Any]]:
    rows = []
    for seed in range(first, first + count):
        kind = KINDS[seed % len(KINDS)]
        scenario = draw(seed, kind)
        started = time.process_time()
        seen, truth = play(scenario, seed)
        row: dict[str, Any] = {"seed": seed, "kind": kind, "refused": isinstance(seen, Refused)}
        if isinstance(seen, Observation):
            played = run(scenario, seed)[0]
            row |= score(seen, played, truth) | {"found": periods_found(seen, truth)}
            row |= {f"{key}_known": value for key, value in _bound(scenario, seed, played).items()}
        row["seconds"] = time.process_time() - started
        rows.append(row)
        print({k: round(v, 4) if isinstance(v, float) else v for k, v in row.items()}, flush=True)
    return rows


def _bound(scenario: dict[str, Any], seed: int, played: Played) -> dict[str, float]:
    """Ripple and load errors of the same chain that starts from the true circuit and must stay there."""
    columns, metadata, truth = record(scenario, seed)
    machine = truth["machine"]
    start = Start(TCircuit(*(machine[key] for key in CIRCUIT)), (1e-6,) * 4, "answer key")
    seen = observe(as_recording(columns, metadata), as_plate(metadata), Wishes(start=start))
    errors = score(seen, played, truth) if isinstance(seen, Observation) else {}
    return {key: errors.get(key, float("nan")) for key in ("ripple", "load")}


def summary(rows: list[dict[str, Any]]) -> str:
    lines = [
        "errors in %: median / 95th percentile (mean speed: / largest); `known`: the same chain with the true circuit",
        f"{'kind':<11} {'n':>4} {'found':>6} | {'speed':>16} {'torque':>12} | {'ripple':>12} {'known':>12} | {'load':>12} {'known':>12}",
    ]
    for kind in (*KINDS, "all"):
        own = [r for r in rows if (kind in (r["kind"], "all")) and not r["refused"]]
        if own:
            speed = np.abs([r["speed"] for r in own])
            rest = [_spread(own, key) for key in ("torque", "ripple", "ripple_known", "load", "load_known")]
            lines.append(
                f"{kind:<11} {len(own):>4} {sum(r['found'] for r in own):>6} | {np.median(speed):>7.4f} /{speed.max():>7.4f} "
                f"{rest[0]} | {rest[1]} {rest[2]} | {rest[3]} {rest[4]}"
            )
    done = [r for r in rows if not r["refused"]]
    for what, limit in (("ripple", 5.0), ("load", 5.0)):
        shares = [
            f"{sum(r[key] <= (10.0 if what == 'ripple' and r['kind'] in MULTI else limit) for r in done)} of {len(done)} ({of})"
            for key, of in ((what, "half peak to peak"), (f"{what}_of_peak", "peak"), (f"{what}_of_rms", "rms"))
        ]
        lines.append(f"{what} within its limit: " + ", ".join(shares))
    for key in ("speed_z", "torque_z", "ripple_z", "load_z"):
        values = np.array([r[key] for r in done])
        lines.append(f"{key}: rms {np.sqrt(np.nanmean(values**2)):.2f}, largest {np.nanmax(np.abs(values)):.2f}")
    return "\n".join(
        [
            *lines,
            f"refused: {[r['seed'] for r in rows if r['refused']]}",
            f"periods missed: {[r['seed'] for r in rows if not r['refused'] and not r['found']]}",
        ]
    )


def _spread(rows: list[dict[str, Any]], key: str) -> str:
    values = np.abs([r[key] for r in rows])
    return f"{np.nanmedian(values):>5.2f} /{np.nanpercentile(values, 95):>5.2f}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("accuracy", "healthy", "leaks"))
    parser.add_argument("count", type=int, nargs="?", default=70)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=12.0, help="length of the healthy recordings")
    parser.add_argument(
        "--machines",
        type=int,
        default=12,
        help="among which the recordings (healthy) are shared, or beside the shipped one (leaks)",
    )
    options = parser.parse_args()
    if options.what == "accuracy":
        print(summary(accuracy(options.count, options.first)))
    else:
        from tests.campaigns.monitor_trend import healthy, leaks

        if options.what == "healthy":
            print(healthy(options.count, options.seconds, options.machines, options.first))
        else:
            print(leaks(options.count, options.machines, options.first))
    return 0


if __name__ == "__main__":
    sys.exit(main())
