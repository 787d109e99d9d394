"""Sheets and recordings in Polish, Turkish, Portuguese and others' words; marks between thousands; symbols that differ by the maker."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from commissioner.recordings.catalogue.reading import sheet_in
from commissioner.recordings.importers import contract_table, read_running

HEADS = {
    "pl": "Próba;Częstotliwość (Hz);Napięcie (V);Prąd (A);Moc (kW)|Prąd stały|Bieg jałowy|Zwarcie",
    "tr": "Deney;Frekans (Hz);Gerilim (V);Akım (A);Güç (kW)|Doğru akım|Boşta çalışma|Kilitli rotor",
    "pt": "Ensaio;Frequência (Hz);Tensão (V);Corrente (A);Potência (kW)|Corrente contínua|Em vazio|Rotor travado",
    "cs": "Zkouška;Frekvence (Hz);Napětí (V);Proud (A);Příkon (kW)|Stejnosměrný proud|Naprázdno|Nakrátko",
    "sv": "Prov;Frekvens (Hz);Spänning (V);Ström (A);Effekt (kW)|Likström|Tomgång|Kortslutning",
    "ru": "Опыт;Частота (Hz);Напряжение (V);Ток (A);Мощность (kW)|Постоянный ток|Холостой ход|Короткое замыкание",
    "zh": "试验;频率 (Hz);电压 (V);电流 (A);功率 (kW)|直流|空载|堵转",
}
LISTS = {
    "es": "Parámetro;Símbolo;Unidad;Valores\nTensión en vacío;U0;V;208\nCorriente en vacío;I0;A;8,17\nPotencia en vacío;P0;W;420\n"
    "Frecuencia en vacío;f0;Hz;60\n",
    "pl": "Parametr;Jednostka;Wartość\nNapięcie biegu jałowego;V;208\nPrąd biegu jałowego;A;8,17\nMoc biegu jałowego;W;420\n"
    "Częstotliwość biegu jałowego;Hz;60\n",
    "tr": "Parametre;Birim;Değer\nBoşta gerilim;V;208\nBoşta akım;A;8,17\nBoşta güç;W;420\nBoşta frekans;Hz;60\n",
}
MAKERS = {
    "pl": "Moc znamionowa|Napięcie znamionowe|Częstotliwość|Prąd znamionowy|Prędkość znamionowa|Współczynnik mocy|Sprawność|Ir/In|Mr/Mn|Mmax/Mn"
    "|Moment bezwładności",
    "tr": "Anma gücü|Anma gerilimi|Frekans|Anma akımı|Anma devri|Güç faktörü|Verim|Ia/In|Ma/Mn|Mk/Mn|Atalet momenti",
    "pt": "Potência nominal|Tensão nominal|Frequência|Corrente nominal|Velocidade nominal|Fator de potência|Rendimento|Ip/In|Cp/Cn|Cmáx/Cn"
    "|Momento de inércia",
    "symbols in brackets": "Output|Voltage|Frequency|Full load current|Full load speed|Power factor 100%|Efficiency 100%|Locked rotor current (Il/In)"
    "|Locked rotor torque (Cl/Cn)|Breakdown torque (Cb/Cn)|Moment of inertia (J)",
    "T_s that starts": "Output PN|Voltage UN|Frequency|Current IN|Speed nN|cos phi|Efficiency|Is/IN|Ts/TN|Tmax/TN|J",
}
UNITS = ["kW", "V", "Hz", "A", "obr/min", "", "%", "", "", "", "kgm2"]
KEYS = ["rated_power_w", "rated_voltage_v", "rated_frequency_hz", "rated_current_a", "rated_speed_rpm", "power_factor", "efficiency", "starting_current_ratio", "starting_torque_ratio", "breakdown_torque_ratio", "inertia_kg_m2"]  # fmt: skip
PRINTED = ["2,2", "400", "50", "4,8", "1435", "0,80", "84,3", "6,9", "2,4", "3,1", "0,0089"]
TRUE = [2200.0, 400.0, 50.0, 4.8, 1435.0, 0.8, 0.843, 6.9, 2.4, 3.1, 0.0089]


def written(tmp_path: Path, text: str, encoding: str = "utf-8") -> Path:
    path = tmp_path / "given.csv"
    path.write_bytes(text.encode(encoding))
    return path


@pytest.mark.parametrize("name", HEADS)
def test_a_table_of_tests_in_other_words(tmp_path: Path, name: str) -> None:
    head, direct, idle, locked = HEADS[name].split("|")
    text = f"{head}\n{direct};0;13,6;28,0;\n{idle};60;208;8,17;0,42\n{locked};15;25;27,9;0,92\n"
    seen = contract_table(written(tmp_path, text)).columns
    assert seen["test"].tolist() == [0.0, 1.0, 2.0] and seen["power_w"][1:].tolist() == [420.0, 920.0]
    assert seen["voltage_line_v"].tolist() == [13.6, 208.0, 25.0] and seen["current_line_a"].tolist() == [
        28.0,
        8.17,
        27.9,
    ]


@pytest.mark.parametrize("name", LISTS)
def test_a_list_of_a_test_in_other_words(tmp_path: Path, name: str) -> None:
    seen = contract_table(written(tmp_path, LISTS[name])).columns
    expected = {"test": 1.0, "frequency_hz": 60.0, "voltage_line_v": 208.0, "current_line_a": 8.17, "power_w": 420.0}
    assert {key: float(seen[key][0]) for key in expected} == expected


@pytest.mark.parametrize("name", MAKERS)
def test_a_makers_sheet_in_other_words(tmp_path: Path, name: str) -> None:
    text = "".join(f"{n};{u};{v}\n" for n, u, v in zip(MAKERS[name].split("|"), UNITS, PRINTED, strict=True))
    sheet = sheet_in(written(tmp_path, text))
    assert sheet is not None and [sheet.get(key) for key in KEYS] == pytest.approx(TRUE)


@pytest.mark.parametrize(
    ("encoding", "names"),
    [
        ("cp1250", "Czas (s);Prąd fazy {};Napięcie międzyfazowe {}{}"),
        ("cp1254", "Zaman (s);{} fazı akımı;{}-{} gerilimi"),
        ("utf-8", "Zeit [s];r0069[0]: Phasenstrom Istwert, Phase {} [A];Spannung {}-{}"),
    ],
)
def test_a_recording_in_other_words(tmp_path: Path, encoding: str, names: str) -> None:
    time, amps, volts = names.split(";")
    phases, t = ("U", "V", "W"), np.arange(64) / 5000.0
    angles = [100 * np.pi * t - 2 * np.pi * k / 3 for k in range(3)]
    columns = [t, *(7 * np.cos(a) for a in angles), *(565 * np.cos(a + 1) for a in angles)]
    head = [time, *(amps.format(p) for p in phases), *(volts.format(p, q) for p, q in zip(phases, "VWU", strict=True))]
    body = [";".join(f"{x:.6g}".replace(".", ",") for x in row) for row in zip(*columns, strict=True)]
    seen = read_running(written(tmp_path, "\n".join([";".join(head), *body]) + "\n", encoding))
    np.testing.assert_allclose(seen.currents_a, columns[1:4], atol=1e-3)
    np.testing.assert_allclose(seen.voltages_v, columns[4:], atol=1e-2)


def test_a_mark_before_three_digits_is_between_thousands_where_all_others_are_the_other_mark(tmp_path: Path) -> None:
    """An inertia of 1,250 kg m2 was read as 1.25 in a sheet with decimal points."""
    printed = ["630", "690", "50", "640", "1,485", "0.89", "95.5", "7.2", "1.1", "2.6", "1,250"]
    names = [
        "Rated output",
        "Rated voltage",
        "Frequency",
        "Rated current",
        "Rated speed",
        "Power factor",
        "Efficiency",
        "IA/IN",
        "MA/MN",
        "MK/MN",
        "Inertia",
    ]
    text = "".join(f"{n};{u};{v}\n" for n, u, v in zip(names, UNITS, printed, strict=True))
    sheet = sheet_in(written(tmp_path, text))
    assert sheet is not None and (sheet.get("rated_speed_rpm"), sheet.get("inertia_kg_m2")) == (1485.0, 1250.0)
    assert "Inertia 1,250: taken as 1250, for decimals stand behind `.`" in sheet.remarks
    unsaid = sheet_in(written(tmp_path, text.replace(".", ",").replace("1,485", "1485")))
    assert unsaid is not None and unsaid.get("inertia_kg_m2") == 1.25
