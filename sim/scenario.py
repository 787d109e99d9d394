"""Scenario files: strict TOML in, frozen facts out. An unknown key or an impossible value is one clear sentence."""

from __future__ import annotations

import csv
import dataclasses
import json
import math
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sim.drive.states import Setup
from sim.physics import effects
from sim.physics.laws import SATURATION_SHAPES, SIGN_SHAPES
from sim.physics.machine import Effect, Heating, Machine, Nameplate, Plant, PowerStage, Sensors

FOLDER = Path(__file__).parent / "scenarios"
MACHINE_TABLE = FOLDER / "machines.csv"
TOP = {
    "name",
    "kind",
    "description",
    "machine",
    "nameplate",
    "power_stage",
    "sensors",
    "heating",
    "effects",
    "drive",
    "interlocks",
    "faults",
    "recording",
    "firmware_map",
    "noise",
    "unlisted",
}
SIGNED = {"offset_a", "shaft_speed_rad_per_s", "heatsink_degc", "winding_degc", "saturation_at_rated_flux"}
CHOICES = {"saturation_shape": SATURATION_SHAPES, "dead_time_shape": SIGN_SHAPES, "threshold_shape": SIGN_SHAPES}
MAY_BE_ZERO = {
    "noise_a",
    "bits",
    "delay_s",
    "lag_s",
    "link_noise_v",
    "threshold_v",
    "slope_ohm",
    "dead_time_s",
    "link_ripple",
    "stator_per_min",
    "rotor_per_min",
    "fault_at_start",
    "serial",
    "magic",
    "firmware",
}


class ScenarioError(Exception):
    """The scenario cannot be used; the text names file, key, value and what would be right."""


@dataclass(frozen=True)
class Segment:
    """One energised stretch of a recording. `zero_s`: zero-voltage time before the excitation starts."""

    axis_deg: float = 0.0
    duration_s: float = 6.0
    bias_v: float = 0.0
    scale: float = 1.0
    ramp_s: float = 0.3
    zero_s: float = 0.0
    tones: tuple[tuple[float, float, float], ...] = ()


@dataclass(frozen=True)
class Scenario:
    name: str
    kind: str
    plant: Plant
    setup: Setup
    faults: tuple[str, ...]
    segments: tuple[Segment, ...]
    has_link_column: bool
    has_w_column: bool
    pause_s: float
    map_shift: int
    document: dict[str, Any]


def names() -> list[str]:
    """Scenarios that come with the simulator."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def find(name: str) -> Path:
    """File of a scenario by name or path."""
    path = FOLDER / f"{name}.toml"
    if path.is_file():
        return path
    if Path(name).is_file():
        return Path(name)
    raise ScenarioError(f"there is no scenario {name!r}: give a file, or one of {', '.join(names())}")


def read_document(name: str, depth: int = 0) -> dict[str, Any]:
    """The TOML of a scenario; `extends` names one it builds on. ScenarioError where that cannot be.

    A `.json` file is an extended model of `commissioner diagnose`, whose `scenario` is taken.
    """
    path = find(name)
    if path.suffix == ".json":
        return {"name": path.stem, **_extended_model(path)}
    try:
        document = tomllib.loads(path.read_text("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{path}: not TOML: {error}") from error
    base = document.pop("extends", None)
    if base is not None and depth > 4:
        raise ScenarioError(f"{path}: extends = {base!r} goes in circles")
    below = read_document(str(base), depth + 1) if base is not None else {}
    return _laid_over(below, {"name": path.stem, **document})


def _extended_model(path: Path) -> dict[str, Any]:
    try:
        document = json.loads(path.read_text("utf-8"))
        return dict(document["scenario"])
    except (ValueError, KeyError, TypeError) as error:
        raise ScenarioError(f"{path}: not an extended model with a scenario: {error}") from error


def _laid_over(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """`above` wins key by key; tables are merged, lists replaced."""
    merged = dict(below)
    for key, value in above.items():
        both = isinstance(value, dict) and isinstance(below.get(key), dict)
        merged[key] = _laid_over(below[key], value) if both else value
    return merged


def load(name: str) -> Scenario:
    """A scenario by name or file."""
    return build(read_document(name), str(find(name)))


def build(document: dict[str, Any], source: str = "scenario") -> Scenario:
    """A scenario from a parsed document; every table checked."""
    _known(document, TOP, source, "")
    kind = document.get("kind", "standstill")
    if kind not in ("standstill", "running"):
        raise ScenarioError(f"{source}: kind = {kind!r}, must be 'standstill' or 'running'")
    drive = dict(document.get("drive", {}))
    plate, machine = motor_of(document, source)
    plant = Plant(
        plate,
        machine,
        _table(PowerStage, document.get("power_stage", {}), source, "power_stage"),
        _table(Sensors, document.get("sensors", {}), source, "sensors"),
        _table(Heating, document.get("heating", {}), source, "heating"),
        _effects(document.get("effects", {}), source),
        _positive(drive.pop("control_period_s", 2e-4), source, "drive.control_period_s"),
    )
    recording = document.get("recording", {})
    _check_noise(document, source)
    _known(recording, {"segments", "link_column", "w_column", "pause_s"}, source, "recording.")
    return Scenario(
        str(document.get("name", "scenario")),
        kind,
        plant,
        _setup(drive, document.get("interlocks", {}), source),
        tuple(document.get("faults", ())),
        _segments(recording.get("segments", []), source),
        bool(recording.get("link_column", True)),
        bool(recording.get("w_column", True)),
        float(recording.get("pause_s", 1.0)),
        int(document.get("firmware_map", {}).get("shift", 0)),
        document,
    )


def _check_noise(document: dict[str, Any], source: str) -> None:
    noise, unlisted = document.get("noise", {}), document.get("unlisted", {})
    _known(noise, {"kind"}, source, "noise.")
    if noise.get("kind", "white") not in ("white", "red", "flicker"):
        raise ScenarioError(f"{source}: noise.kind = {noise['kind']!r}, must be white, red or flicker")
    _known(unlisted, {"voltage_curvature", "sensor_slew", "echo"}, source, "unlisted.")


def _known(table: Any, allowed: set[str], source: str, where: str) -> None:
    if not isinstance(table, dict):
        raise ScenarioError(f"{source}: {where.rstrip('.')} must be a table, not {table!r}")
    for key in table:
        if key not in allowed:
            raise ScenarioError(f"{source}: unknown key {where}{key}; known: {', '.join(sorted(allowed))}")


def _positive(value: Any, source: str, key: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value) or value <= 0:
        raise ScenarioError(f"{source}: {key} = {value!r} must be a number above 0")
    return float(value)


def _table(kind: type, table: Any, source: str, where: str) -> Any:
    fields = {f.name: f for f in dataclasses.fields(kind)}
    _known(table, set(fields), source, where + ".")
    return kind(**{key: _value(key, value, fields[key].default, source, where) for key, value in table.items()})


def _value(key: str, value: Any, default: Any, source: str, where: str) -> Any:
    if isinstance(default, str):
        if value not in CHOICES[key]:
            raise ScenarioError(f"{source}: {where}.{key} = {value!r}, must be one of {', '.join(CHOICES[key])}")
        return value
    if isinstance(default, tuple):
        if not isinstance(value, list) or len(value) != len(default):
            raise ScenarioError(f"{source}: {where}.{key} = {value!r} must be a list of {len(default)} numbers")
        return tuple(_number(v, key, source, where) for v in value)
    if isinstance(default, bool):
        if not isinstance(value, bool):
            raise ScenarioError(f"{source}: {where}.{key} = {value!r} must be true or false")
        return value
    number = _number(value, key, source, where)
    return int(number) if isinstance(default, int) else number


def _number(value: Any, key: str, source: str, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ScenarioError(f"{source}: {where}.{key} = {value!r} must be a finite number")
    if key not in SIGNED and (value < 0 or (value == 0 and key not in MAY_BE_ZERO)):
        raise ScenarioError(f"{source}: {where}.{key} = {value!r} must be above 0")
    return value


def motor_of(document: dict[str, Any], source: str) -> tuple[Nameplate, Machine]:
    """Nameplate and machine; `machine.id` starts from a row of the machine table."""
    table = dict(document.get("machine", {}))
    plate = dict(document.get("nameplate", {}))
    if "id" in table:
        row_plate, row_machine = table_machine(str(table.pop("id")), table.get("saturation_at_rated_flux", 0.3), source)
        plate, table = {**row_plate, **plate}, {**row_machine, **table}
    return _table(Nameplate, plate, source, "nameplate"), _table(Machine, table, source, "machine")


def table_rows() -> list[dict[str, str]]:
    """Rows of the machine table: T circuits with their sources."""
    with MACHINE_TABLE.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def table_machine(
    row_id: str, saturation: float, source: str = "machines.csv"
) -> tuple[dict[str, Any], dict[str, Any]]:
    """(nameplate, Gamma machine) of a row; the row's inductance is taken as the secant value at rated flux.

    Gamma from T: g = L_s/L_m; L_leak = g L_ls + g^2 L_lr, R_r' = g^2 R_r.
    """
    row = next((r for r in table_rows() if r["id"] == row_id), None)
    if row is None:
        known = ", ".join(r["id"] for r in table_rows())
        raise ScenarioError(f"{source}: machine.id = {row_id!r} is not in the machine table: {known}")
    value = {k: float(v) for k, v in row.items() if k not in ("id", "name", "source") and v}
    ls = value["Lls_mH"] + value["Lm_mH"]
    g = ls / value["Lm_mH"]
    speed = 60.0 * value["f_Hz"] / (value["poles"] / 2)
    plate = {
        "rated_power_w": 1e3 * value["P_kW"],
        "rated_voltage_v": value["V_LL"],
        "rated_frequency_hz": value["f_Hz"],
        "rated_current_a": value.get("I_n_A", value["I_calc_A"]),
        "rated_speed_rpm": value.get("n_n_rpm", speed * (1.0 - value["slip_calc"])),
        "power_factor": value.get("pf_n", value["pf_calc"]),
        "pole_pairs": round(value["poles"] / 2),
    }
    machine = {
        "stator_resistance_ohm": value["Rs_ohm"],
        "rotor_resistance_ohm": g * g * value["Rr_ohm"],
        "leakage_inductance_h": 1e-3 * (g * value["Lls_mH"] + g * g * value["Llr_mH"]),
        "inductance_h": 1e-3 * ls * (1.0 + saturation),
    }
    return plate, machine


def _effects(table: Any, source: str) -> tuple[Effect, ...]:
    _known(table, set(effects.CATALOGUE), source, "effects.")
    return tuple(_effect(name, entry, source) for name, entry in table.items())


def _effect(name: str, entry: Any, source: str) -> Effect:
    if isinstance(entry, (int, float)) and not isinstance(entry, bool):
        entry = {"size": entry}
    kind = effects.CATALOGUE[name]
    if not isinstance(entry, dict) or not isinstance(entry.get("size"), (int, float)):
        raise ScenarioError(f"{source}: effects.{name} needs size in {kind.unit}")
    shape = entry.get("shape", "")
    if shape and shape not in kind.shapes:
        raise ScenarioError(f"{source}: effects.{name}.shape = {shape!r}, must be one of {', '.join(kind.shapes)}")
    details = {k: float(v) for k, v in entry.items() if k not in ("size", "shape")}
    return Effect(name, float(entry["size"]), shape, details)


def _setup(drive: dict[str, Any], interlocks: dict[str, Any], source: str) -> Setup:
    parameters = drive.pop("parameters", None)
    fixed = {
        "interlocks",
        "parameters",
        "ignores",
        "commit_sticks",
        "store_fails",
        "refuses",
        "heeds_heartbeat",
        "runs_away",
    }
    defaults = Setup()
    fields = {f.name for f in dataclasses.fields(Setup)} - fixed
    _known(drive, fields, source, "drive.")
    known = {"sto_released", "remote_control", "shaft_at_rest", "supply_ok", "no_other_master", "fault_stays"}
    _known(interlocks, known, source, "interlocks.")
    values: dict[str, Any] = {}
    for key, value in drive.items():
        default = getattr(defaults, key)
        if key == "drive_type":
            values[key] = str(value)
        elif isinstance(default, bool):
            values[key] = _value(key, value, default, source, "drive")
        else:
            number = _number(value, key, source, "drive")
            values[key] = int(number) if isinstance(default, int) or default is None else float(number)
    if parameters is not None:
        values["parameters"] = _parameters(parameters, source)
    return Setup(**values, interlocks={k: bool(v) for k, v in interlocks.items()})


def _parameters(entry: Any, source: str) -> tuple[float, ...]:
    keys = ("stator_resistance_ohm", "rotor_resistance_ohm", "leakage_inductance_h", "magnetizing_inductance_h")
    _known(entry, set(keys), source, "drive.parameters.")
    missing = [k for k in keys if k not in entry]
    if missing:
        raise ScenarioError(f"{source}: drive.parameters needs {', '.join(missing)}")
    return tuple(_positive(entry[k], source, f"drive.parameters.{k}") for k in keys)


def _segments(entries: Any, source: str) -> tuple[Segment, ...]:
    allowed = {f.name for f in dataclasses.fields(Segment)}
    segments = []
    for j, entry in enumerate(entries):
        _known(entry, allowed, source, f"recording.segments[{j}].")
        tones = tuple(tuple(float(v) for v in tone) for tone in entry.get("tones", ()))
        if any(len(tone) != 3 for tone in tones):
            raise ScenarioError(
                f"{source}: recording.segments[{j}].tones must be [amplitude_v, frequency_hz, phase_rad]"
            )
        segment = Segment(**{**entry, "tones": tones})
        if not 0.0 < segment.duration_s <= 3600.0:
            raise ScenarioError(
                f"{source}: recording.segments[{j}].duration_s = {segment.duration_s} must be in (0, 3600]"
            )
        segments.append(segment)
    return tuple(segments)
