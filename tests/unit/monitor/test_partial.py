"""Partial data give partial answers: currents without voltages, no plate, short stretches; what is withheld has its reason."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from commissioner.cli.screens.monitoring import show_partial
from commissioner.errors import ConfigurationError
from commissioner.monitor.intake.states.stretches import states
from commissioner.monitor.periods.periods import beside_multiple, pair_spectrum
from commissioner.monitor.periods.side_bands import rotor_side_bands
from commissioner.operations.recordings.monitor import MonitorRequest, NotMonitored, PartlyMonitored, monitor
from commissioner.recordings.imported import store, understand
from commissioner.recordings.importers import contract_table
from commissioner.recordings.table import write_table
from commissioner.records import RunningRecording

DATA = Path(__file__).parents[2] / "data" / "intake"
PLATE = {
    "rated_power_w": 2250.0, "rated_voltage_v": 400.0, "rated_frequency_hz": 50.0, "rated_current_a": 4.86, "rated_speed_rpm": 1436.0,
    "power_factor": 0.78, "pole_pairs": 2.0, "connection": "star",
}  # fmt: skip
SHAFT_HZ = 24.285


def columns(seconds: float = 6.0, rate_hz: float = 2000.0, volts: bool = False, backwards: bool = False) -> dict:
    """Currents of 50 Hz, modulated once a turn; noise 5 mA."""
    t = np.arange(round(seconds * rate_hz)) / rate_hz
    random = np.random.default_rng(5)
    swing = 1 + 0.02 * np.cos(2 * np.pi * SHAFT_HZ * t) + 0.02j * np.cos(2 * np.pi * SHAFT_HZ * t - 0.7)
    vector = 5.6 * swing * np.exp(1j * (2 * np.pi * 50 * t - 0.85))
    sign = -1 if backwards else 1
    out = {"time_s": t}
    for k, p in enumerate("uvw"):
        turn = np.exp(-2j * np.pi * sign * k / 3)
        out[f"current_{p}_a"] = (vector * turn).real + 5e-3 * random.standard_normal(t.size)
        if volts:
            out[f"voltage_{p}_v"] = 326.6 * (np.exp(2j * np.pi * 50 * t) * turn).real
    return out


def watched(tmp_path: Path, made: dict, plate: dict, **wishes) -> PartlyMonitored:
    path = tmp_path / "recording.csv"
    write_table(path, made, plate)
    done = monitor(MonitorRequest(path, **wishes))
    assert isinstance(done, PartlyMonitored), done
    return done


@pytest.mark.parametrize("backwards", [False, True])
def test_currents_alone_give_speed_periods_and_indicators(tmp_path: Path, backwards: bool) -> None:
    document = watched(tmp_path, columns(backwards=backwards), PLATE).document
    speed = document["mean_speed_rad_per_s"]
    assert speed["value"] == pytest.approx(2 * np.pi * SHAFT_HZ, abs=4 * speed["std"] + 1e-3) and speed["std"] < 0.1
    assert document["periods"][0]["frequency_hz"] == pytest.approx(SHAFT_HZ, abs=0.01)
    assert document["indicators"]["current_rms_a"] == pytest.approx(5.6 / np.sqrt(2), rel=5e-3)
    assert document["mean_torque_nm"] is None
    assert {"mean_torque_nm", "parameters", "power_w", "power_factor"} <= set(document["withheld"])
    assert all("voltages" in document["withheld"][n] for n in ("mean_torque_nm", "power_w"))


def test_currents_alone_have_a_trend(tmp_path: Path) -> None:
    baseline = tmp_path / "history.json"
    for _ in range(3):
        watched(tmp_path, columns(), PLATE, baseline=baseline, learn=True)
    same = watched(tmp_path, columns(), PLATE, baseline=baseline).document
    assert same["trend"]["state"] == "normal"
    odd = columns()
    for k, p in enumerate("uvw"):
        odd[f"current_{p}_a"] += 0.3 * np.cos(2 * np.pi * 50 * odd["time_s"] + 2 * np.pi * k / 3)
    assert "current_unbalance" in watched(tmp_path, odd, PLATE, baseline=baseline).document["trend"]["alarms"]


def test_without_a_plate_the_terminals_are_told_and_no_speed(tmp_path: Path) -> None:
    document = watched(tmp_path, columns(volts=True), {}).document
    said = document["indicators"]
    assert said["supply_frequency_hz"] == pytest.approx(50.0, abs=1e-3)
    assert said["voltage_rms_v"] == pytest.approx(326.6 / np.sqrt(2), rel=1e-3)
    assert said["power_factor"] == pytest.approx(np.cos(0.85), abs=0.01)
    assert document["periods"][0]["frequency_hz"] == pytest.approx(SHAFT_HZ, abs=0.1)
    assert document["mean_speed_rad_per_s"] is None and "nameplate" in document["withheld"]["mean_speed_rad_per_s"]


def test_a_plate_given_in_part_is_still_an_error(tmp_path: Path) -> None:
    path = tmp_path / "recording.csv"
    write_table(path, columns(volts=True), {"rated_power_w": 2250.0})
    with pytest.raises(ConfigurationError):
        monitor(MonitorRequest(path))


@pytest.mark.parametrize(
    ("file", "torque_nm", "speed", "unused"),
    [("off_start_step_off.csv.gz", 5.0, 155.05, "load step"), ("ramp.csv.gz", 6.0, 154.61, "ramp")],
)
def test_steady_stretches_under_two_seconds_have_torque_and_speed(file, torque_nm, speed, unused) -> None:
    done = monitor(MonitorRequest(DATA / file))
    assert isinstance(done, PartlyMonitored)
    document = done.document
    for key, true in (("mean_torque_nm", torque_nm), ("mean_speed_rad_per_s", speed)):
        assert document[key]["value"] == pytest.approx(true, abs=2 * document[key]["std"])
    assert "too short to tell a period" in document["withheld"]["parameters"]
    assert unused in document["withheld"]["from other states"]
    assert [s["used"] for s in document["states"]].count(True) == 1


def test_a_loss_in_the_middle_and_direct_current_are_states() -> None:
    made = columns(3.0, volts=True)
    keep = (made["time_s"] < 1.0) | (made["time_s"] > 1.5)
    i = tuple(made[f"current_{p}_a"][keep] for p in "uvw")
    v = tuple(made[f"voltage_{p}_v"][keep] for p in "uvw")
    seen = states(RunningRecording(made["time_s"][keep], i, v, False, None, 5e-4), None)
    assert [s.state for s in seen] == ["steady", "lost", "steady"]
    assert (seen[1].start_s, seen[1].end_s) == pytest.approx((1.0, 1.5), abs=1e-3)
    t = made["time_s"]
    held = tuple(np.full(t.size, x) for x in (4.0, -2.0, -2.0))
    still = states(RunningRecording(t, held, tuple(3.0 * x for x in held), False, None, 5e-4), None)
    assert [s.state for s in still] == ["standstill"]


def test_the_band_stands_under_the_picture_of_an_import(tmp_path: Path) -> None:
    table, document = understand(DATA / "off_start_step_off.csv.gz")
    names = [s["state"] for s in document["states"]]
    assert names == ["off", "start", "steady", "load step", "steady", "coast-down"]
    assert document["states"][0]["end_s"] == pytest.approx(0.2, abs=1e-3)
    page = Path(store(table, document, tmp_path / "out.csv")["picture"]).read_text("utf-8")
    assert "what state the motor was in" in page


def even(scale: float = 1.0) -> dict:
    """A load that modulates nothing; currents that read `scale` times too large."""
    made = columns(volts=True)
    random = np.random.default_rng(7)
    for k, p in enumerate("uvw"):
        turn = np.exp(-1j * (0.85 + 2 * np.pi * k / 3))
        clean = (5.6 * np.exp(2j * np.pi * 50 * made["time_s"]) * turn).real
        made[f"current_{p}_a"] = scale * (clean + 5e-3 * random.standard_normal(clean.size))
    return made


def test_a_load_without_ripple_has_torque_and_speed_of_the_terminals(tmp_path: Path) -> None:
    """Nothing modulates the current: the air-gap power is known all the same, and light load has no less iron loss."""
    document = watched(tmp_path, even(), PLATE).document
    power, copper = 1.5 * 326.6 * 5.6 * np.cos(0.85), 1.5 * 3.7 * 5.6**2
    torque, speed = document["mean_torque_nm"], document["mean_speed_rad_per_s"]
    assert torque["value"] == pytest.approx((power - copper) / (50 * np.pi), abs=torque["std"])
    assert torque["std"] > 0.02 * np.sqrt(3) * 400.0 * 4.86 / (50 * np.pi) > 0.1 * torque["std"]
    assert 0.0 < 50 * np.pi - speed["value"] < 2 * (50 * np.pi - 1436 * np.pi / 30)
    assert document["indicators"]["slip"] == pytest.approx(1 - speed["value"] / (50 * np.pi), abs=1e-5)
    assert "neither the shaft" in document["withheld"]["periods"]


@pytest.mark.parametrize("scale", [np.sqrt(3.0), 1.0 / np.sqrt(3.0), 2.0])
def test_the_plate_is_asked_where_the_shaft_is_not_seen(tmp_path: Path, scale: float) -> None:
    """By the power factor, which a scale of the currents leaves: what the terminals would tell is wrong by that scale."""
    right = watched(tmp_path, even(), PLATE).document["mean_torque_nm"]
    path = tmp_path / "scaled.csv"
    write_table(path, even(scale), PLATE)
    refused = monitor(MonitorRequest(path))
    assert isinstance(refused, NotMonitored) and "do not belong to this plate" in refused.error.what
    by_data = watched(tmp_path, even(scale), PLATE, trust="data").document
    assert by_data["mean_torque_nm"]["value"] == pytest.approx(scale * right["value"], rel=0.2 * max(scale, 1.0))
    assert "plate_contradiction" in {f["code"] for f in by_data["audit"]["findings"]}
    by_plate = watched(tmp_path, even(scale), PLATE, trust="plate").document
    assert by_plate["mean_torque_nm"]["value"] == pytest.approx(right["value"], rel=1e-3)
    assert "currents_by_plate" in {f["code"] for f in by_plate["audit"]["findings"]}


def test_the_plate_is_asked_of_a_short_stretch(tmp_path: Path) -> None:
    table = contract_table(DATA / "off_start_step_off.csv.gz", None, None)
    scaled = {k: v * (np.sqrt(3.0) if k.startswith("current") else 1.0) for k, v in table.columns.items()}
    path = tmp_path / "scaled.csv"
    write_table(path, scaled, table.metadata)
    refused = monitor(MonitorRequest(path))
    assert isinstance(refused, NotMonitored) and "do not belong to this plate" in refused.error.what
    assert not any("mean_torque_nm" in state for state in refused.document["states"])


def test_half_a_second_has_the_terminals_torque_and_a_tenth_has_none(tmp_path: Path) -> None:
    made = even()
    half = {name: values[made["time_s"] < 0.5] for name, values in made.items()}
    told, long = watched(tmp_path, half, PLATE).document, watched(tmp_path, made, PLATE).document
    assert told["mean_torque_nm"]["value"] == pytest.approx(long["mean_torque_nm"]["value"], rel=0.01)
    write_table(
        path := tmp_path / "tenth.csv", {name: values[made["time_s"] < 0.1] for name, values in made.items()}, PLATE
    )
    refused = monitor(MonitorRequest(path))
    assert isinstance(refused, NotMonitored) and refused.document["refused_because"]["code"] == "too_short"


def test_a_line_beyond_the_slip_that_the_power_allows_is_no_shaft(tmp_path: Path) -> None:
    """A pulse pattern's half supply period, 2 in a thousand above synchronous speed: taken for the shaft, a motor became a generator."""
    made = {name: values[:6000] for name, values in even().items()}
    beyond = 1.0 + sum(0.02 * np.cos(2 * np.pi * h * 25.05 * made["time_s"]) for h in (1, 3, 5))
    made |= {f"current_{p}_a": made[f"current_{p}_a"] * beyond for p in "uvw"}
    document = watched(tmp_path, made, PLATE).document
    assert document["mean_speed_rad_per_s"]["value"] < 50 * np.pi
    assert document["mean_torque_nm"]["value"] > 5.0


FULL = {
    "mean_speed_rad_per_s", "mean_torque_nm", "slip", "parameters", "waveforms", "current_resimulation_error", "negative_sequence_excess_percent",
    "rotor_side_bands", "supply_frequency_hz", "voltage_rms_v", "voltage_unbalance", "current_rms_a", "current_unbalance", "runs_backwards",
    "power_w", "reactive_power_var", "power_factor",
}  # fmt: skip
"""What a full answer tells of a motor, by the names of the contract."""


@pytest.mark.parametrize(
    ("made", "plate"), [(columns(), PLATE), (columns(volts=True), {}), (columns(), {}), (even(), PLATE)]
)
def test_all_that_a_full_answer_tells_is_there_or_has_its_reason(tmp_path: Path, made: dict, plate: dict) -> None:
    document = watched(tmp_path, made, plate).document
    told = {name for name, value in {**document, **document["indicators"]}.items() if value is not None}
    withheld = document["withheld"]
    assert told | set(withheld) >= FULL and not told - {"periods"} & set(withheld)
    assert all(withheld.values())


def swinging(beside_hz: float) -> dict:
    """Both side bands, 1 % each, at `beside_hz` from the supply's line."""
    made = columns(20.0)
    for k, p in enumerate("uvw"):
        turn = 2 * np.pi * (50 * made["time_s"] - k / 3) - 0.85
        made[f"current_{p}_a"] += 5.6 * 0.02 * np.cos(2 * np.pi * beside_hz * made["time_s"]) * np.cos(turn)
    return made


def test_side_bands_at_twice_the_slip_are_told_with_all_that_makes_them(tmp_path: Path) -> None:
    """At 2 s f = 2 (50 - 2 x 24.285) Hz stand a rotor's and a load's alike; a hertz beside stand a load's, and none are the rotor's."""
    twice_slip_hz = 2 * (50 - 2 * SHAFT_HZ)
    document = watched(tmp_path, swinging(twice_slip_hz), PLATE).document
    bands = document["indicators"]["rotor_side_bands"]
    assert bands["offset_hz"] == pytest.approx(twice_slip_hz, abs=0.02)
    assert bands["level_db"] == pytest.approx(20 * np.log10(0.01), abs=0.5)
    (note,) = (f for f in document["audit"]["findings"] if f["code"] == "side_bands")
    assert "broken rotor bars" in note["what"] and "a load that swings" in note["what"]
    for other in (columns(20.0), swinging(twice_slip_hz + 1)):
        document = watched(tmp_path, other, PLATE).document
        assert document["indicators"]["rotor_side_bands"]["above_floor_db"] < note["limit"]
        assert "side_bands" not in {f["code"] for f in document["audit"]["findings"]}


def test_a_generators_side_bands_lie_at_twice_its_slip_too() -> None:
    t = np.arange(8000) / 400.0
    random = np.random.default_rng(3)
    noise = 1e-3 * (random.standard_normal(t.size) + 1j * random.standard_normal(t.size))
    spectrum = pair_spectrum(0.02 * np.cos(2 * np.pi * 1.5 * t) + noise, 1 / 400, 180.0)
    driven, driving = (rotor_side_bands(spectrum, 50.0, slip, 1.0) for slip in (0.015, -0.015))
    assert driven == driving is not None
    assert driving.level_db == pytest.approx(-40.0, abs=0.5)


@pytest.mark.parametrize("frequency_hz", [0.4, 24.9, 25.0, 62.5, 149.3])
def test_the_distance_to_the_nearest_multiple(frequency_hz: float) -> None:
    multiples = 50.0 * np.arange(5)
    assert beside_multiple(frequency_hz, 50.0) == np.abs(frequency_hz - multiples).min()
    assert beside_multiple(frequency_hz, 50.0, first=1) == np.abs(frequency_hz - multiples[1:]).min()


@pytest.mark.parametrize("kept", ["u", "uv"])
def test_voltages_too_few_for_a_vector_leave_what_the_currents_tell(tmp_path: Path, kept: str) -> None:
    made = columns(volts=True)
    few = {n: x for n, x in made.items() if not n.startswith("voltage_") or n[8] in kept}
    document = watched(tmp_path, few, PLATE).document
    assert document["mean_speed_rad_per_s"]["value"] == pytest.approx(2 * np.pi * SHAFT_HZ, abs=0.1)
    assert f"voltage_{kept[-1]}_v alone" in document["withheld"]["mean_torque_nm"]


@pytest.mark.parametrize(("made", "plate"), [(even, PLATE), (columns, PLATE), (columns, {})])
def test_a_speed_column_beside_a_partial_answer_is_compared_with_it(tmp_path: Path, made, plate) -> None:
    """No line of the shaft, no voltages, no plate: what the column reads had been passed over."""
    table = made()
    table["speed_rad_per_s"] = np.full(table["time_s"].size, 2 * np.pi * SHAFT_HZ)
    document = watched(tmp_path, table, plate).document
    beside, own = document["reference_speed"], document["mean_speed_rad_per_s"]
    assert beside["mean_speed_rad_per_s"] == pytest.approx(2 * np.pi * SHAFT_HZ)
    assert own is None or beside["mean_speed_error_in_std"] == pytest.approx(
        (own["value"] - 2 * np.pi * SHAFT_HZ) / own["std"], rel=1e-3
    )
    show_partial(document)


def test_a_shaft_that_is_seen_tells_the_speed_where_a_slow_load_has_too_few_periods(tmp_path: Path) -> None:
    made = columns(volts=True)
    for p in "uvw":
        made[f"current_{p}_a"] *= 1 + 0.01 * np.cos(2 * np.pi * 0.7 * made["time_s"])
    document = watched(tmp_path, made, PLATE).document
    speed = document["mean_speed_rad_per_s"]
    assert "too few to tell a period" in document["withheld"]["waveforms"]
    assert speed["std"] < 0.1 and speed["value"] == pytest.approx(2 * np.pi * SHAFT_HZ, abs=3 * speed["std"])


def of_phase(made: dict, phase: str) -> dict:
    return {name: x for name, x in made.items() if not name.startswith("current_") or name == f"current_{phase}_a"}


@pytest.mark.parametrize("phase", "uvw")
def test_one_current_tells_speed_and_side_bands_and_nothing_of_the_phases(tmp_path: Path, phase: str) -> None:
    """A clamp meter's recording: it was refused."""
    made = of_phase(columns(), phase)
    made[f"current_{phase}_a"] += 0.4  # a clamp's offset
    made[f"current_{phase}_a"][3000:3004] = np.nan
    document = watched(tmp_path, made, PLATE).document
    speed = document["mean_speed_rad_per_s"]
    assert speed["value"] == pytest.approx(2 * np.pi * SHAFT_HZ, abs=4 * speed["std"] + 1e-3) and speed["std"] < 0.1
    assert document["indicators"]["current_rms_a"] == pytest.approx(5.6 / np.sqrt(2), rel=5e-3)
    assert document["indicators"]["supply_frequency_hz"] == pytest.approx(50.0, abs=1e-3)
    assert {"mean_torque_nm", "current_unbalance", "runs_backwards"} <= set(document["withheld"])
    assert not {"current_unbalance", "runs_backwards"} & set(document["indicators"])
    codes = [finding["code"] for finding in document["audit"]["findings"]]
    assert codes.count("one_current") == 1 and "computed_current" not in codes
    show_partial(document)


def test_one_current_without_a_plate_tells_its_size_and_what_modulates_it(tmp_path: Path) -> None:
    document = watched(tmp_path, of_phase(columns(), "v"), {}).document
    assert document["periods"][0]["frequency_hz"] == pytest.approx(SHAFT_HZ, abs=0.05)
    assert document["indicators"]["current_rms_a"] == pytest.approx(5.6 / np.sqrt(2), rel=5e-3)
    assert "current_unbalance" in document["withheld"]


def test_one_current_has_a_trend(tmp_path: Path) -> None:
    baseline = tmp_path / "baseline.json"
    for _ in range(2):
        document = watched(tmp_path, of_phase(columns(), "u"), PLATE, baseline=baseline, learn=True).document
    assert document["trend"] is not None


def test_the_side_bands_of_one_current_are_those_of_three(tmp_path: Path) -> None:
    made = swinging(2 * (50 - 2 * SHAFT_HZ))
    levels = [
        watched(tmp_path, x, PLATE).document["indicators"]["rotor_side_bands"] for x in (made, of_phase(made, "w"))
    ]
    assert levels[1]["level_db"] == pytest.approx(levels[0]["level_db"], abs=0.2)
    assert levels[1]["above_floor_db"] > 20.0
