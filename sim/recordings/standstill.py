"""Standstill recordings: excite the simulated machine segment by segment, sample it as a logger would."""

from __future__ import annotations

import dataclasses
import gzip
import math
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pa_parquet

from sim.physics import layout as at
from sim.physics.compiled import kernel
from sim.physics.kernel import coast, play_voltages
from sim.physics.machine import Effect, Plant
from sim.physics.packing import fresh_state, pack
from sim.physics.sensing import between, convert, phase_of, sense
from sim.scenario import Scenario, Segment
from sim.truth import answer_key

ACCURACY = 4.0
"""Integration steps are this much finer than the live drive's: the solver's error stays far below the noise."""

Columns = dict[str, np.ndarray]


def record(scenario: Scenario, seed: int) -> tuple[Columns, dict[str, Any], dict[str, Any]]:
    """(columns, metadata, truth) of the scenario's segments; the same seed gives the same bits.

    Columns and metadata keys are those of the recording contract. ValueError where there is no segment.
    """
    if not scenario.segments:
        raise ValueError(f"scenario {scenario.name!r} has no recording.segments")
    plant = scenario.plant
    p, s = pack(plant, accuracy=ACCURACY)
    x = fresh_state(p)
    coast(x, p, 0.0)  # open terminals: remanence without a stator current
    random = np.random.default_rng([seed, 7])
    stretches = [_play(segment, x, p, scenario, first=j == 0) for j, segment in enumerate(scenario.segments)]
    _set_clip(plant, s, stretches)
    parts = [_sample(stretch, j, plant, scenario, s, random) for j, stretch in enumerate(stretches)]
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    if not scenario.has_link_column:
        del columns["dc_link_v"]
    if not scenario.has_w_column:
        del columns["current_w_a"]
    truth = answer_key(scenario, seed) | _peaks(stretches, s, plant)
    return columns, _metadata(scenario), truth


@dataclasses.dataclass(frozen=True)
class _Stretch:
    """One segment as it really was: start time, command, sensed alpha-beta points, link voltage, largest fluxes."""

    start_s: float
    axis_deg: float
    command_v: np.ndarray
    points: np.ndarray
    link_v: np.ndarray
    stator_flux_wb: float
    rotor_flux_wb: float


def _play(segment: Segment, x: np.ndarray, p: np.ndarray, scenario: Scenario, *, first: bool) -> _Stretch:
    """Run one segment from the machine's present state, then let it rest."""
    if not first:
        coast(x, p, scenario.pause_s)
        _remagnetize(x, p, scenario.plant)
    command = command_voltage(segment, p[at.P_PERIOD])
    applied = _bend_command(command, scenario)
    points = np.zeros((command.size, at.POINTS, 2))
    link = np.zeros(command.size)
    start = round(float(x[at.X_TIME]) / p[at.P_PERIOD]) * p[at.P_PERIOD]
    x[at.X_PEAK_S] = x[at.X_PEAK_R] = 0.0
    play_voltages(x, p, applied, math.radians(segment.axis_deg), points, link)
    return _Stretch(start, segment.axis_deg, command, points, link, float(x[at.X_PEAK_S]), float(x[at.X_PEAK_R]))


def _remagnetize(x: np.ndarray, p: np.ndarray, plant: Plant) -> None:
    """Remanence of shape `every_segment`: the iron keeps some flux through every pause."""
    if any(e.name == "remanence" and e.shape == "every_segment" for e in plant.effects):
        x[2:4] = p[[at.P_FLUX0_C, at.P_FLUX0_S]] * 0.7
        coast(x, p, 0.0)


def command_voltage(segment: Segment, period_s: float) -> np.ndarray:
    """Axis voltage (V) per control period: zero stretch, then (bias + scale * tones) under a linear ramp."""
    t = np.arange(round(segment.duration_s / period_s)) * period_s
    ramp = np.clip((t - segment.zero_s) / max(segment.ramp_s, period_s), 0.0, 1.0)
    tones = sum(a * np.cos(2.0 * math.pi * f * t + phase) for a, f, phase in segment.tones)
    return ramp * (segment.bias_v + segment.scale * tones) + 0.0


def _unlisted(scenario: Scenario) -> dict[str, float]:
    """Causes that no catalogue names (voltage_curvature, sensor_slew, echo), for data whose right verdict is `unexplained`."""
    return scenario.document.get("unlisted", {})


def _bend_command(command: np.ndarray, scenario: Scenario) -> np.ndarray:
    k = _unlisted(scenario).get("voltage_curvature", 0.0)
    if not k:
        return command
    top = max(float(np.max(np.abs(command))), 1e-9)
    return command * (1.0 - k * (command / top) ** 2)


def _set_clip(plant: Plant, s: np.ndarray, stretches: list[_Stretch]) -> None:
    """The clipping effect's size is the part of the recording's own peak that is cut off."""
    effect = _named(plant, "clipping")
    if effect is None or "limit_a" in effect.details:
        return
    alpha_beta = np.concatenate([stretch.points[:, 0, :] for stretch in stretches])
    peak = max(float(np.max(np.abs(_phase(alpha_beta[:, 0], alpha_beta[:, 1], k)))) for k in range(3))
    s[at.S_CLIP_A] = (1.0 - effect.size) * peak


def _phase(a: np.ndarray, b: np.ndarray, phase: int) -> np.ndarray:
    half = 0.5 * math.sqrt(3.0)
    return a if phase == 0 else -0.5 * a + (half if phase == 1 else -half) * b


def _named(plant: Plant, name: str) -> Effect | None:
    return next((e for e in plant.effects if e.name == name), None)


def _sample(
    stretch: _Stretch, number: int, plant: Plant, scenario: Scenario, s: np.ndarray, random: np.random.Generator
) -> Columns:
    """What the logger writes down of one segment."""
    n, period = stretch.command_v.size, plant.control_period_s
    places = _sampling_places(n, plant, s, random, period, stretch.start_s)
    noise = _noise(scenario.document.get("noise", {}), (n, 3), random)
    cable = _cable_current(stretch, s, period)
    t = stretch.start_s + np.arange(n) * period
    currents = np.zeros((n, 3))
    _sense_rows(stretch.points, places, t, noise, cable, s, currents)
    _spoil(currents, scenario, period)
    link = np.round((stretch.link_v + s[at.S_LINK_NOISE_V] * random.standard_normal(n)) / s[at.S_LINK_LSB_V])
    columns = {
        "time_s": t,
        "segment": np.full(n, number, np.int64),
        "axis_deg": np.full(n, stretch.axis_deg),
        "voltage_axis_v": stretch.command_v,
        "current_u_a": currents[:, 0],
        "current_v_a": currents[:, 1],
        "current_w_a": currents[:, 2],
        "dc_link_v": link * s[at.S_LINK_LSB_V],
    }
    return _lose_rows(columns, plant, random)


@kernel
def _sense_rows(points, places, t, noise, cable, s, out):
    """Sample, bend, offset, clip and convert every row; `places` in control periods from the segment's start.

    At the very edge of a period a sample shows what was there before the voltage stepped.
    """
    n = points.shape[0]
    for k in range(n):
        place = min(max(places[k], 0.0), float(n))
        which = max(math.ceil(place) - 1, 0)
        a, b = between(points[which], place - which)
        for phase in range(3):
            seen = sense(phase_of(a, b, phase) + cable[k, phase], t[k], phase, noise[k, phase], s)
            out[k, phase] = convert(seen, s[at.S_LSB_A])


def _sampling_places(
    n: int, plant: Plant, s: np.ndarray, random: np.random.Generator, period: float, start_s: float
) -> np.ndarray:
    """When each current sample was really taken (in control periods): delay, clock drift, lost current samples."""
    k = np.arange(n, dtype=float)
    places = k - s[at.S_DELAY] / period
    delay, clock, lost = (_named(plant, name) for name in ("sampling_delay", "clock_drift", "lost_samples"))
    if delay is not None and delay.shape == "alternating":
        places -= 0.2 * delay.size / period * np.where(np.arange(n) % 2, 1.0, -1.0)
    if clock is not None:
        wander = np.sin(2.0 * math.pi * k / max(n, 1)) if clock.shape == "wandering" else 1.0
        places += np.cumsum(np.full(n, 1e-6 * clock.size) * wander)
        if clock.details.get("runs_on", 0.0):  # not set anew with every segment
            places += 1e-6 * clock.size * start_s / period
    if lost is not None and lost.shape != "whole_rows":
        for where in random.integers(n // 10, n - n // 10, round(lost.size)):
            if lost.shape == "held":
                places[where] = places[where - 1]
            else:
                places[where:] += 1.0
    return places


def _lose_rows(columns: Columns, plant: Plant, random: np.random.Generator) -> Columns:
    """Rows that never were written, with the time column renumbered as if nothing had happened."""
    lost = _named(plant, "lost_samples")
    if lost is None or lost.shape != "whole_rows":
        return columns
    n = columns["time_s"].size
    gone = random.choice(np.arange(n // 10, n - n // 10), round(lost.size), replace=False)
    kept = {name: np.delete(values, gone) for name, values in columns.items()}
    kept["time_s"] = columns["time_s"][: kept["time_s"].size]
    return kept


def _cable_current(stretch: _Stretch, s: np.ndarray, period: float) -> np.ndarray:
    """Charging current (A) of the cable behind the sensors from one control period's mean voltage to the next."""
    u = stretch.command_v * stretch.link_v / stretch.link_v.mean()
    step = s[at.S_CABLE_F] * np.diff(u, prepend=0.0) / period
    if s[at.S_CABLE_SHAPE] == 1.0:
        step = 0.7 * step + 0.3 * np.concatenate([[0.0], step[:-1]])
    axis = math.radians(stretch.axis_deg)
    return np.stack([step * math.cos(axis - k * 2.0 * math.pi / 3.0) for k in (0, 1, -1)], axis=1)


def _noise(entry: dict[str, Any], shape: tuple[int, int], random: np.random.Generator) -> np.ndarray:
    """Unit-variance-white based noise: `white`, `red` (AR(1) 0.7, same variance) or `flicker` (white + 1/f)."""
    white = random.standard_normal(shape)
    kind = entry.get("kind", "white")
    if kind == "red":
        from scipy.signal import lfilter

        return lfilter([math.sqrt(1.0 - 0.49)], [1.0, -0.7], white, axis=0)
    if kind == "flicker":
        n = shape[0]
        spectrum = np.fft.rfft(random.standard_normal(shape), axis=0)
        f = np.arange(spectrum.shape[0], dtype=float)[:, None]
        shaped = np.fft.irfft(spectrum * np.sqrt(n / 500.0 / np.maximum(f, 1.0)) * (f > 0), n, axis=0)
        return white + shaped
    return white


def _spoil(currents: np.ndarray, scenario: Scenario, period: float) -> None:
    """Causes outside every catalogue: a slew-limited sensor, an echo."""
    slew = _unlisted(scenario).get("sensor_slew", 0.0)
    if slew:
        _limit_slew(currents, slew * period)
    echo = _unlisted(scenario).get("echo", 0.0)
    if echo:
        back = round(0.005 / period)
        currents[back:] += echo * currents[:-back].copy()


@kernel
def _limit_slew(currents, step):
    for phase in range(currents.shape[1]):
        for k in range(1, currents.shape[0]):
            change = currents[k, phase] - currents[k - 1, phase]
            if abs(change) > step:
                currents[k, phase] = currents[k - 1, phase] + math.copysign(step, change)


def _peaks(stretches: list[_Stretch], s: np.ndarray, plant: Plant) -> dict[str, Any]:
    """True flux peaks per segment and, where it clips, the limit."""
    out: dict[str, Any] = {
        "segments": [
            {"axis_deg": q.axis_deg, "stator_flux_wb": q.stator_flux_wb, "rotor_flux_wb": q.rotor_flux_wb}
            for q in stretches
        ]
    }
    if _named(plant, "clipping"):
        out["clip_a"] = float(s[at.S_CLIP_A])
    return out


def _metadata(scenario: Scenario) -> dict[str, Any]:
    plant = scenario.plant
    return dataclasses.asdict(plant.nameplate) | {
        "connection": "star",
        "switching_frequency_hz": plant.power_stage.switching_frequency_hz,
        "sample_period_s": plant.control_period_s,
        "kind": "standstill",
        "scenario": scenario.name,
    }


def write_table(path: Path, columns: Columns, metadata: dict[str, Any]) -> None:
    """CSV (`.csv`, `.csv.gz`: `# key: value` lines, header, rows) or Parquet (`.parquet`: keys in the schema)."""
    table = pa.table({name: pa.array(values) for name, values in columns.items()})
    if path.suffix == ".parquet":
        keyed = table.replace_schema_metadata({k: str(v) for k, v in metadata.items()})
        pa_parquet.write_table(keyed, path)
        return
    if path.suffix not in (".csv", ".gz"):
        raise ValueError(f"{path}: a recording is .csv, .csv.gz or .parquet")
    with gzip.open(path, "wb") if path.suffix == ".gz" else path.open("wb") as file:
        file.write("".join(f"# {k}: {v}\n" for k, v in metadata.items()).encode())
        file.write((",".join(columns) + "\n").encode())
        pa_csv.write_csv(table, file, pa_csv.WriteOptions(include_header=False, quoting_style="none"))
