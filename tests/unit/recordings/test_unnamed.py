"""Six channels that nobody named: told by their signals beside the plate, or asked for; never another reading."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np
import pytest

from commissioner.errors import DataRefused
from commissioner.motor.nameplate import prior
from commissioner.recordings.importers import read_running
from commissioner.settings import load_motor

PLATE = "motor_2kw2"
TURN = np.exp(-2j * np.pi / 3.0 * np.arange(3))
TIME = np.arange(1500) / 5000.0
CHANNELS = [f"CH{k}" for k in range(1, 7)]


def phasors(slip, kind="line", hz=50.0, off=(1.0, 1.0)):
    """Currents and voltages of the plate's typical motor, its leakage and magnetizing inductance `off` by factors."""
    plate, w = load_motor(PLATE), 2.0 * np.pi * hz
    c = prior(plate).typical
    volts = plate.rated_voltage_v * np.sqrt(2.0 / 3.0) * hz / 50.0
    rotor, main = c.rotor_resistance_ohm / slip, 1j * w * off[1] * c.magnetizing_inductance_h
    amps = volts / (c.stator_resistance_ohm + 1j * w * off[0] * c.leakage_inductance_h + rotor * main / (rotor + main))
    line = np.sqrt(3.0) * np.exp(1j * np.pi / 6.0) if kind == "line" else 1.0
    return amps * TURN, volts * line * TURN


def written(path, amps, volts, hz=50.0, units="A,A,A,V,V,V", rng=np.random.default_rng(3)):  # noqa: B008
    both = np.concatenate([amps, volts])
    rows = np.real(both[:, None] * np.exp(2j * np.pi * hz * TIME)).T
    rows = rows + 0.01 * np.abs(both) * rng.standard_normal(rows.shape)
    body = "\n".join(",".join(f"{x:.5g}" for x in (t, *row)) for t, row in zip(TIME, rows, strict=True))
    path.write_text("TIME," + ",".join(CHANNELS) + f"\ns,{units}\n{body}\n", "utf-8")
    return path


@pytest.mark.parametrize("kind", ["line", "phase"])
@pytest.mark.parametrize(("slip", "hz"), [(0.003, 50.0), (0.02, 50.0), (0.043, 47.3), (0.06, 31.0)])
def test_signals_of_the_plates_motor_in_their_order_are_told_and_said(tmp_path, kind, slip, hz):
    amps, volts = phasors(slip, kind, hz)
    seen = read_running(written(tmp_path / "scope.csv", amps, volts, hz), motor=PLATE)
    assert seen.voltages_are_line_to_line is (kind == "line")
    np.testing.assert_allclose(
        seen.currents_a[1], np.real(amps[1] * np.exp(2j * np.pi * hz * TIME)), atol=0.06 * abs(amps[0])
    )
    (note,) = [n.what for n in seen.notes if n.code == "named_by_signals"]
    volts_said = float(note.split("so it is ")[1].split(" V")[0])
    assert volts_said == pytest.approx(400.0 * hz / 50.0, rel=0.01) and "--map" in note


def test_units_scale_what_is_told(tmp_path):
    amps, volts = phasors(0.03)
    path = written(tmp_path / "scope.csv", 1e3 * amps, volts, units="mA,mA,mA,V,V,V")
    assert np.max(np.abs(read_running(path, motor=PLATE).currents_a[0])) == pytest.approx(abs(amps[0]), rel=0.06)


@pytest.mark.parametrize("kind", ["line", "phase"])
@pytest.mark.parametrize("off", [(1.0, 1.0), (0.75, 1.3), (1.3, 0.75)])
def test_no_other_order_or_sign_of_the_channels_is_ever_taken_for_the_right_one(tmp_path, kind, off):
    """All orders of the voltages with all channels either way round: the right one, the phases called otherwise together, or a question."""
    taken = 0
    for slip in (0.004, 0.03):
        amps, volts = phasors(slip, kind, off=off)
        for order, sign in product(permutations(range(3)), (1, -1)):
            path = written(tmp_path / "scope.csv", amps, sign * volts[list(order)])
            try:
                read_running(path, motor=PLATE)
            except DataRefused as refusal:
                assert "--map" in refusal.remedy
                continue
            taken += 1
            assert (order, sign) == ((0, 1, 2), 1)
    assert taken >= 1


@pytest.mark.parametrize("change", ["units", "plate", "one turned", "volts"])
def test_what_is_ambiguous_is_asked_for(tmp_path, change):
    amps, volts = phasors(0.03)
    units, motor = "A,A,A,V,V,V", PLATE
    if change == "units":
        units = ",,,,,"
    elif change == "plate":
        motor = None
    elif change == "one turned":
        amps = amps * [1, -1, 1]
    else:
        volts = 1.3 * volts
    with pytest.raises(DataRefused) as refused:
        read_running(written(tmp_path / "scope.csv", amps, volts, units=units), motor=motor)
    assert "--map" in refused.value.remedy


@pytest.mark.parametrize("word", ["Kanal", "Voie", "Canal", "Canale", "Kanaal", "Channel"])
def test_channels_without_names_in_other_languages_are_told_alike(tmp_path, word):
    amps, volts = phasors(0.03)
    path = written(tmp_path / "scope.csv", amps, volts)
    path.write_text(path.read_text("utf-8").replace("CH", f"{word} "), "utf-8")
    seen = read_running(path, motor=PLATE)
    assert [n.code for n in seen.notes if n.code == "named_by_signals"]
    assert np.max(np.abs(seen.currents_a[0])) == pytest.approx(abs(amps[0]), rel=0.06)


@pytest.mark.parametrize(
    "said", ["Fréquence d'échantillonnage : 5 kHz", "Frecuencia de muestreo: 5 kHz", "Pas de temps : 0.2 ms", "Zeitschritt: 200 µs",
             "Frequenza di campionamento: 5000 Hz", "Paso de tiempo: 0.2 ms"],
)  # fmt: skip
def test_the_rate_above_columns_without_a_time_is_read_in_other_languages(tmp_path, said):
    amps, volts = phasors(0.03)
    lines = written(tmp_path / "scope.csv", amps, volts).read_text("utf-8").splitlines()
    rows = "\n".join(line.partition(",")[2] for line in lines[2:])
    path = tmp_path / "rate.csv"
    path.write_text(f"{said}\nI1 (A),I2 (A),I3 (A),U12 (V),U23 (V),U31 (V)\n{rows}\n", "utf-8")
    assert read_running(path, motor=PLATE).sample_period_s == pytest.approx(2e-4)
