"""What lines above a recording's columns say of the plate in anybody's words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from commissioner.recordings.importers import contract_table
from commissioner.recordings.plate import plate_of
from commissioner.recordings.table import Table


def read(tmp_path: Path, above: str, mark: str = ",") -> Table:
    rows = [
        [0.001 * k, *(np.cos(0.3 * k - 2.1 * p) for p in (0, 1, 2)), *(np.sin(0.3 * k - 2.1 * p) for p in (0, 1, 2))]
        for k in range(40)
    ]
    body = "\n".join(mark.join(f"{x:.4f}" for x in row) for row in rows)
    path = tmp_path / "recording.csv"
    names = mark.join(
        f"{name} [{unit}]" for name, unit in zip(["t", "Ia", "Ib", "Ic", "Va", "Vb", "Vc"], "sAAAVVV", strict=True)
    )
    path.write_text(f"{above}\n{names}\n{body if mark == ',' else body.replace('.', ',')}\n", encoding="utf-8")
    return contract_table(path)


@pytest.mark.parametrize(
    "said",
    ["GD2: 0.176 kg m2", "GD² [kgm²]: 0.176", "inertia (J = GD²/4): 0.044 kg m2", "J = GD²/4: 0.044 kg m²", "J: 0.044 kg m2 (GD² = 0.176)",
     "Massenträgheitsmoment: 0,044 kgm²", "J [kg cm²]: 440", "Schwungmoment GD²: 0,176 kpm²"],
)  # fmt: skip
def test_an_inertia_above_the_columns_is_the_plates(tmp_path, said):
    table = read(tmp_path, f"# {said}")
    assert table.metadata["inertia_kg_m2"] == pytest.approx(0.044)
    assert "plate_said" in [note.code for note in table.notes]


@pytest.mark.parametrize(
    ("above", "mark"),
    [
        ("Bench 3\nRated power: 2.2 kW\nRated voltage: 400 V\nRated frequency: 50 Hz\nRated current: 4.86 A\nRated speed: 1436 rpm\n"
         "Power factor: 0.78\nNumber of poles: 4\nConnection: Y\n", ","),
        ("Prüfstand\nBemessungsleistung;2,2 kW\nBemessungsspannung;400 V\nBemessungsfrequenz;50 Hz\nBemessungsstrom;4,86 A\n"
         "Bemessungsdrehzahl;1436 1/min\ncos φ;0,78\nPolpaarzahl;2\nSchaltung;Stern\n", ";"),
        ("P_N [kW],2.2\nU_N [V],230/400\nf_N [Hz],50\nI_N [A],8.4/4.86\nn_N [1/min],1436\ncos phi_N,0.78\nconnection,star\n", ","),
    ],
)  # fmt: skip
def test_a_plate_above_the_columns_is_understood(tmp_path, above, mark):
    table = read(tmp_path, above, mark)
    plate = plate_of(table.metadata, table.source, None)
    found = (
        plate.rated_power_w,
        plate.rated_voltage_v,
        plate.rated_frequency_hz,
        plate.rated_current_a,
        plate.rated_speed_rpm,
    )
    assert (*found, plate.power_factor, plate.pole_pairs, plate.connection) == (
        2200,
        400,
        50,
        4.86,
        1436,
        0.78,
        2,
        "star",
    )


def test_what_is_not_called_rated_or_is_no_value_of_it_is_not_the_plates(tmp_path):
    table = read(tmp_path, "Frequency: 40 Hz\nPower factor: 0.5\nVoltage: 320 V\nJ: 12 apples\nn: 400")
    assert (
        not {"rated_frequency_hz", "power_factor", "rated_voltage_v", "inertia_kg_m2", "rated_speed_rpm"}
        & table.metadata.keys()
    )
    assert "plate_not_said" in [note.code for note in table.notes]


def test_the_contracts_own_key_stands_and_the_other_is_named(tmp_path):
    table = read(tmp_path, "# inertia_kg_m2: 0.015\n# GD²: 0.176 kg m²")
    assert table.metadata["inertia_kg_m2"] == 0.015
    assert any(note.code == "plate_apart" and "0.044" in note.what for note in table.notes)
