"""Parameters behind a hard inverter, by the simulator's answer key: `python -m tests.campaigns.inverter [draws] [first]`.

3 us dead time at 5-8 kHz, 1.4 V device threshold, 12-bit sensors, 150 us delay, 1 % noise, saturating iron; three axes
and the first again. Machine, knees (0.03-0.3 A on a 5 A motor), shape of the loss, iron and the plan of the test are
drawn: `stairs` (DC levels of both signs, then tones: what the product's own run does), `rich` (two levels and a DC
bias), `tones` (one level, nothing else). Gains are exact and nothing heats: both are invisible to one recording.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from commissioner.identify.analysis import Identification, identify
from commissioner.records import StandstillRecording
from sim.physics.inductance import inverse_gamma
from sim.physics.machine import Machine
from sim.recordings.hidden import impedance
from sim.recordings.standstill import record
from sim.scenario import Scenario, build, table_machine, table_rows

NAMES = ("stator_resistance_ohm", "rotor_resistance_ohm", "leakage_inductance_h", "magnetizing_inductance_h")
TARGET_PERCENT = np.array([0.5, 2.0, 1.0, 2.0])
PLANS = ("stairs", "rich", "tones")
CURRENT_SHARE, FLUX_SHARE = 0.8, 0.85
"""Largest current and stator flux of a test, of the rated peaks."""
SHARES = {0.5: 0.55, 2.3: 0.35, 9.7: 0.25, 41.9: 0.22, 113.3: 0.12, 331.7: 0.06}


@dataclass(frozen=True)
class Outcome:
    """Relative errors and standard errors in percent, (R_s, R_R, L_sigma, L_M)."""

    label: str
    error: np.ndarray
    stated: np.ndarray
    result: Identification


def to_recording(columns: dict[str, np.ndarray], metadata: dict[str, Any]) -> StandstillRecording:
    """The simulator's columns as the record the estimators take."""
    return StandstillRecording(
        columns["time_s"],
        columns["segment"].astype(np.int64),
        columns["axis_deg"],
        columns["voltage_axis_v"],
        columns["current_u_a"],
        columns["current_v_a"],
        columns.get("current_w_a"),
        columns.get("dc_link_v"),
        float(metadata["sample_period_s"]),
        metadata,
    )


def draw(seed: int, plan: str = "") -> Scenario:
    """Machine, inverter, sensors and test of one draw; amplitudes set so that current and flux stay inside."""
    random = np.random.default_rng([seed, 41])
    rows = {r["id"]: r for r in table_rows() if 0.5 <= float(r["P_kW"]) <= 40.0 and 350 <= float(r["V_LL"]) <= 500}
    saturation = float(random.uniform(0.15, 0.5))
    chosen_row = str(random.choice(list(rows)))
    plate, machine = table_machine(chosen_row, saturation)
    if _is_per_unit_base(plate):
        plate["rated_current_a"] = float(rows[chosen_row]["I_calc_A"])
    machine |= {
        "saturation_at_rated_flux": saturation,
        "saturation_order": float(random.uniform(5.0, 9.0)),
        "saturation_shape": str(random.choice(["power", "power", "exponential"])),
    }
    scale = plate["rated_current_a"] / 5.0
    knee = np.exp(random.uniform(np.log(0.03), np.log(0.3), 2)) * scale
    peak = np.sqrt(2.0) * plate["rated_current_a"]
    document: dict[str, Any] = {
        "name": f"inverter-{seed}",
        "nameplate": plate,
        "machine": machine,
        "power_stage": {
            "dead_time_s": 3e-6,
            "switching_frequency_hz": float(random.choice([5000.0, 8000.0])),
            "dead_time_knee_a": float(knee[0]),
            "dead_time_shape": str(random.choice(["capacitive", "capacitive", "tanh", "arctan"])),
            "threshold_v": 1.4,
            "threshold_knee_a": float(knee[1]),
            "slope_ohm": 0.02 / scale,
        },
        "sensors": {
            "noise_a": 0.01 * 0.35 * peak,
            "bits": 12,
            "full_scale_a": 3.0 * peak,
            "offset_a": [0.005 * peak, -0.004 * peak, 0.003 * peak],
            "gain": [1.0, 1.0, 1.0],
            "delay_s": 1.5e-4,
        },
        "heating": {"stator_per_min": 0.0, "rotor_per_min": 0.0},
    }
    chosen = plan or PLANS[seed % len(PLANS)]
    document["recording"] = {"segments": _plan(chosen, document, random)}
    return build(document)


def _is_per_unit_base(plate: dict[str, Any]) -> bool:
    """Krause's machines state P / (sqrt(3) U), the base of their per-unit values, as current: no plate carries that."""
    base_a = plate["rated_power_w"] / (np.sqrt(3.0) * plate["rated_voltage_v"])
    return bool(abs(plate["rated_current_a"] / base_a - 1.0) < 0.02)


def _plan(plan: str, document: dict[str, Any], random: np.random.Generator) -> list[dict[str, Any]]:
    tones = _tones(document, random)
    ac = {"ramp_s": 0.3, "zero_s": 0.2, "duration_s": 6.0, "tones": tones}
    if plan == "tones":
        return [{**ac, "axis_deg": a, "duration_s": 12.0} for a in (0.0, 60.0, 120.0, 0.0)]
    if plan == "rich":
        bias = _dc_voltage(document, 0.5)
        shapes = ((1.0, 0.0), (0.5, 0.0), (0.25, bias))
        return [{**ac, "axis_deg": a, "scale": s, "bias_v": b} for a in (0.0, 60.0, 120.0, 0.0) for s, b in shapes]
    top = 0.45
    stairs = [_dc_voltage(document, sign * share * top) for sign in (1.0, -1.0) for share in (1.0, 0.6, 0.3)]
    return [
        segment
        for a in (0.0, 60.0, 120.0, 0.0)
        for segment in (
            *({"axis_deg": a, "duration_s": 1.2, "ramp_s": 0.05, "bias_v": v, "tones": []} for v in stairs),
            {**ac, "axis_deg": a},
        )
    ]


def _dc_voltage(document: dict[str, Any], share: float) -> float:
    """Command that drives this share of the rated peak current, dead time and threshold included."""
    stage = document["power_stage"]
    lost = stage["dead_time_s"] * stage["switching_frequency_hz"] * 540.0 + stage["threshold_v"]
    peak = np.sqrt(2.0) * document["nameplate"]["rated_current_a"]
    return float(share * peak * document["machine"]["stator_resistance_ohm"] + np.sign(share) * 4.0 / 3.0 * lost)


def _tones(document: dict[str, Any], random: np.random.Generator) -> list[tuple[float, float, float]]:
    """Volts, hertz, radians; turned up until the simulated machine carries the wanted current or flux."""
    model, plate = Machine(**document["machine"]), document["nameplate"]
    peak = np.sqrt(2.0) * plate["rated_current_a"]
    tones = [
        (share * peak * abs(impedance(model, f)), f, float(random.uniform(-np.pi, np.pi)))
        for f, share in SHARES.items()
    ]
    factor = 0.5
    for _ in range(6):
        scaled = [(factor * v, f, phase) for v, f, phase in tones]
        segment = {"axis_deg": 0.0, "duration_s": 3.0, "tones": scaled}
        columns, _, truth = record(build({**document, "recording": {"segments": [segment]}}), 0)
        current = float(np.max(np.abs(columns["current_u_a"]))) / (CURRENT_SHARE * peak)
        flux = truth["segments"][0]["stator_flux_wb"] / (FLUX_SHARE * truth["rated_flux_wb"])
        factor *= float(np.clip(max(current, flux, 0.2) ** -0.7, 0.5, 2.0))
    return scaled


def outcome(seed: int, plan: str = "", estimator: str = "pao") -> Outcome:
    """Measure one draw and compare it with the key at the flux the result names."""
    scenario = draw(seed, plan)
    columns, metadata, truth = record(scenario, seed)
    result = identify(to_recording(columns, metadata), estimator=estimator)  # type: ignore[arg-type]
    key = inverse_gamma(scenario.plant, result.holds_for_flux_wb)
    exact = np.array([key[n] for n in NAMES])
    exact[0] = truth["apparent_stator_resistance_ohm"]
    found = np.array(result.parameters.as_tuple())
    stage, plate = scenario.plant.power_stage, scenario.plant.nameplate
    label = (
        f"{plan or PLANS[seed % len(PLANS)]:6s} {plate.rated_power_w / 1e3:5.2f} kW "
        f"{stage.dead_time_shape[:5]} {stage.switching_frequency_hz / 1e3:.0f} kHz "
        f"knees {stage.dead_time_knee_a * 5 / plate.rated_current_a:.2f} "
        f"{stage.threshold_knee_a * 5 / plate.rated_current_a:.2f}"
    )
    return Outcome(label, 100.0 * (found / exact - 1.0), 100.0 * np.array(result.std) / exact, result)


def main(draws: int = 40, first: int = 0, plan: str = "") -> int:
    """1 where a draw could not be measured, or a value is beyond both its target and three of its stated standard errors."""
    print("errors (stated standard errors) in %: R_s / R_R / L_sigma / L_M")
    rows: list[Outcome] = []
    for seed in range(first, first + draws):
        begun = time.perf_counter()
        try:
            rows.append(outcome(seed, plan))
        except Exception as error:  # a campaign counts what it cannot measure
            print(f"{seed:3d} {draw(seed, plan).name} FAILED {type(error).__name__}: {error}"[:230], flush=True)
            continue
        values = "  ".join(f"{e:+6.2f} ({s:4.2f})" for e, s in zip(rows[-1].error, rows[-1].stated, strict=True))
        print(f"{seed:3d} {rows[-1].label:44s} {values}  {time.perf_counter() - begun:.0f} s", flush=True)
    for name in PLANS:
        chosen = [r for r in rows if r.label.startswith(name)]
        if chosen:
            _summarise(name, np.array([r.error for r in chosen]), np.array([r.stated for r in chosen]))
    return int(len(rows) < draws or any(_is_beyond(row) for row in rows))


def _is_beyond(row: Outcome) -> bool:
    return bool(np.any(np.abs(row.error) > np.maximum(TARGET_PERCENT, 3.0 * np.asarray(row.stated))))


def _summarise(name: str, errors: np.ndarray, stated: np.ndarray) -> None:
    inside = np.mean(np.abs(errors) < TARGET_PERCENT, axis=0)
    covered = np.mean(np.abs(errors) < 1.96 * stated, axis=0)
    print(
        f"{name:6s} of {len(errors)}: inside the target {np.round(100 * inside)} %, covered {np.round(100 * covered)} %, "
        f"rms {np.round(np.sqrt(np.mean(errors**2, axis=0)), 2)} %, worst {np.round(np.max(np.abs(errors), axis=0), 2)} %"
    )


if __name__ == "__main__":
    raise SystemExit(main(*(int(a) for a in sys.argv[1:3]), *sys.argv[3:4]))
