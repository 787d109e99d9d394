"""Real recordings and published indicator tables (tests/data, each with its SOURCE.md)."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from commissioner.monitor.intake.audit import inspect, measure_fundamental
from commissioner.monitor.periods.periods import pair_spectrum, slip_of
from commissioner.monitor.periods.side_bands import rotor_side_bands
from commissioner.monitor.signals.supply import dominant_frequency_hz, follow_supply, space_vector
from commissioner.motor.nameplate import Nameplate
from commissioner.motor.running import from_nameplate, slip_at_power
from commissioner.recordings.formats.matlab import vectors
from commissioner.recordings.importers import read_running
from tests.support.running import refused_in

DATA = Path(__file__).parents[2] / "data"
LIAS = Nameplate(1100, 400, 50, 2.6, 1425, 0.78, 2, "star")


def test_lias_sequence_components_and_power_are_those_of_its_source() -> None:
    recording = read_running(DATA / "lias_mcsadc_excerpt" / "ccs1_first_100ms.csv")
    f = inspect(recording, LIAS, from_nameplate(LIAS)).fundamental
    assert f.frequency_hz == pytest.approx(49.99, abs=0.01)
    assert abs(f.voltage_v) / np.sqrt(2) == pytest.approx(225.4, abs=0.2)
    assert abs(f.current_a) / np.sqrt(2) == pytest.approx(2.291, abs=0.003)
    assert 100 * f.voltage_unbalance == pytest.approx(0.23, abs=0.02)
    assert 100 * f.current_unbalance == pytest.approx(1.1, abs=0.05)
    assert f.power_w == pytest.approx(1203, abs=2)
    assert f.reactive_var == pytest.approx(975, abs=3)


def test_lias_slip_is_predicted_from_the_plate_within_its_tolerance() -> None:
    """Source: 4.01 %. A plate's slip carries 20 % (IEC 60034-1)."""
    recording = read_running(DATA / "lias_mcsadc_excerpt" / "ccs1_first_100ms.csv")
    circuit = from_nameplate(LIAS)
    f = inspect(recording, LIAS, circuit).fundamental
    slip = slip_at_power(circuit, 2 * np.pi * f.frequency_hz, abs(f.voltage_v), f.power_w)
    assert slip == pytest.approx(0.0401, rel=0.2)
    assert slip_of(1439.5 / 60, 49.99, 2) == pytest.approx(0.0401, abs=2e-4)


def test_lias_excerpt_of_two_turns_is_refused_as_too_short() -> None:
    refused = refused_in(read_running(DATA / "lias_mcsadc_excerpt" / "ccs1_first_100ms.csv"), LIAS)
    assert refused.reason.code == "too_short"


def unbalances() -> dict[str, list[float]]:
    """|I-|/|I+| of all 65 records, by class, in the order of the repetitions."""
    read = vectors(DATA / "itsc_baldor" / "Data_ITSC.mat")
    out: dict[str, list[float]] = {}
    for name in sorted(key[:-2] for key in read if key.endswith(".0")):
        current = space_vector(*(read[f"{name}.{k}"] for k in range(3)))
        frequency = dominant_frequency_hz(current, 1e-3)
        supply = follow_supply(current, 1e-3, frequency)
        unbalance = measure_fundamental(current, current, supply, 1e-3, backwards=False).current_unbalance
        out.setdefault(name.split(".")[1].removeprefix("ITSC_"), []).append(unbalance)
    return out


def test_shorted_turns_raise_the_negative_sequence_class_by_class() -> None:
    found = unbalances()
    assert {len(values) for values in found.values()} == {5} and len(found) == 13
    for phase in "ABC":
        medians = [np.median(found[f"{phase}{percent}"]) for percent in (10, 20, 30, 40)]
        assert np.median(found["HLT"]) < medians[0] < medians[1] < medians[2] < medians[3]


def test_two_records_look_mislabelled_and_are_named() -> None:
    """Those that lie within the healthy range though labelled faulty."""
    found = unbalances()
    healthy = max(found["HLT"])
    flagged = [
        (name, k + 1) for name, values in found.items() if name != "HLT" for k, v in enumerate(values) if v <= healthy
    ]
    assert flagged == [("A10", 2), ("B20", 2)]


def rows(name: str) -> list[dict[str, str]]:
    with (DATA / "mcc5_derived" / name).open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize(
    ("name", "speed", "offset"),
    [
        ("health_baseline_plateaus.csv", "rpm_meas", "sb_offset_Hz"),
        ("broken_bar_headline.csv", "rpm", "off_2s_Hz"),
    ],
)
def test_slip_and_side_band_position_are_those_of_the_published_tables(name: str, speed: str, offset: str) -> None:
    """2-pole motor: slip in per cent, side bands 2 s f from the supply frequency; speeds are printed to 0.1 1/min."""
    for row in rows(name):
        supply = float(row["f1_Hz"])
        slip = slip_of(float(row[speed]) / 60, supply, 1)
        assert 100 * slip == pytest.approx(float(row["slip_pct"]), abs=0.02)
        assert 2 * slip * supply == pytest.approx(float(row[offset]), abs=0.01)


@pytest.mark.parametrize("row", [r for r in rows("broken_bar_headline.csv") if float(r["headline_snr"]) > 15])
def test_side_bands_as_high_as_published_are_measured_above_the_floor(row: dict[str, str]) -> None:
    """A current with the table's side-band level, slip and frequency over a 60 dB floor reads back its level."""
    level = 0.5 * (float(row["lsb1_dB"]) + float(row["usb1_dB"]))
    supply, offset = float(row["f1_Hz"]), float(row["off_2s_Hz"])
    period = 1 / 400
    time = np.arange(int(16 / period)) * period
    rng = np.random.default_rng(11)
    noise = 0.01 * (rng.standard_normal(time.size) + 1j * rng.standard_normal(time.size))
    current = 10 ** (level / 20) * 2 * np.cos(2 * np.pi * offset * time) + noise
    bands = rotor_side_bands(pair_spectrum(current, period, 180.0), supply, offset / (2 * supply), 1.0)
    assert bands is not None
    assert bands.offset_hz == pytest.approx(offset)
    assert bands.level_db == pytest.approx(level, abs=1.0)
    assert bands.above_floor_db > 15
