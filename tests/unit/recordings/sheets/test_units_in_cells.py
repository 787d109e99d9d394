"""Units behind every number, tables below each other, units elsewhere than in brackets, other languages: the samples are the contract's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from commissioner.errors import DataRefused
from commissioner.recordings.importers import contract_table, read_running
from commissioner.recordings.names import meaning_of, meanings_of, unit_of
from commissioner.recordings.sheets.united import united

N, RATE_HZ = 400, 2000.0
T = np.arange(N) / RATE_HZ
THIRD = 2.0 * np.pi / 3.0
AMPS = [np.round(0.73 * np.cos(314.16 * T - k * THIRD - 0.6), 4) for k in range(3)]
PHASE = [np.round(326.6 * np.cos(314.16 * T - k * THIRD), 3) for k in range(3)]
VOLTS = [PHASE[k] - PHASE[(k + 1) % 3] for k in range(3)]
NAMES = ("Time", "Ia", "Ib", "Ic", "Vab", "Vbc", "Vca")


def table(names, columns, mark: str = ";") -> str:
    lines = [mark.join(names), *(mark.join(row) for row in zip(*columns, strict=True))]
    return "\n".join(lines) + "\n"


def cells(values, unit: str, scale: float = 1.0, comma: bool = False) -> list[str]:
    out = [f"{x * scale:.7g}{unit}" for x in values]
    return [c.replace(".", ",") for c in out] if comma else out


def read(folder: Path, text: str, name: str = "x.csv", encoding: str = "utf-8"):
    path = folder / name
    path.write_bytes(text.encode(encoding))
    return read_running(path)


def require_right(seen, volts=VOLTS) -> None:
    assert seen.sample_period_s == pytest.approx(1.0 / RATE_HZ, rel=1e-6)
    for truth, got in zip((*AMPS, *volts), (*seen.currents_a, *seen.voltages_v), strict=True):
        np.testing.assert_allclose(got, truth, atol=1e-3)


def mixed(values, unit: str) -> list[str]:
    """As meters print: below one in thousandths."""
    return [f"{x * 1e3:.4f} m{unit}" if abs(x) < 1.0 else f"{x:.7g} {unit}" for x in values]


@pytest.mark.parametrize("comma", [False, True])
@pytest.mark.parametrize(
    ("names", "units"),
    [
        (NAMES, ((" s", 1.0), (" A", 1.0), (" V", 1.0))),
        (NAMES, (("ms", 1e3), (" mA", 1e3), ("kV", 1e-3))),
        (("Time [ms]", "Ia [mA]", "Ib [A]", *NAMES[3:]), ((" s", 1.0), (" mA", 1e3), (" V", 1.0))),
    ],
)
def test_a_unit_in_every_cell_counts_there(tmp_path, names, units, comma):
    time, amps, volts = units
    columns = [
        cells(T, *time, comma),
        *(cells(x, *amps, comma) for x in AMPS),
        *(cells(x, *volts, comma) for x in VOLTS),
    ]
    require_right(read(tmp_path, table(names, columns)))


def test_prefixes_may_differ_from_cell_to_cell(tmp_path):
    columns = [cells(T, " s"), *(mixed(x, "A") for x in AMPS), *(mixed(x, "V") for x in VOLTS)]
    require_right(read(tmp_path, table(NAMES, columns, ",")))


def test_a_row_of_units_above_such_cells_is_not_applied_twice(tmp_path):
    columns = [cells(T, " ms", 1e3), *(cells(x, " mA", 1e3) for x in AMPS), *(cells(x, " V") for x in VOLTS)]
    text = table(NAMES, columns).replace("\n", "\nms;mA;mA;mA;V;V;V\n", 1)
    require_right(read(tmp_path, text))


def test_a_table_of_tests_may_have_units_in_its_cells(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text(
        "Test,f,U,I,P\nDC,0 Hz,24 V,8 A,192 W\nNo load,50 Hz,400 V,3400 mA,0.22 kW\nLocked rotor,50 Hz,88 V,8.5 A,560 W\n"
    )
    seen = contract_table(path).columns
    np.testing.assert_allclose(seen["current_line_a"], [8.0, 3.4, 8.5])
    np.testing.assert_allclose(seen["power_w"], [192.0, 220.0, 560.0])
    np.testing.assert_allclose(seen["voltage_line_v"], [24.0, 400.0, 88.0])


def test_quantities_down_the_rows_are_not_taken_for_columns(tmp_path):
    text = "quantity;no load;locked\nU12;400 V;88 V\nU23;401 V;88 V\nU31;399 V;88 V\nI;3.4 A;8.5 A\n"
    assert united(text, "x") == text


def test_a_cell_that_measures_something_else_is_refused(tmp_path):
    amps = cells(AMPS[0], " A")
    amps[N // 2] = amps[N // 2].replace("A", "V")
    columns = [cells(T, " s"), amps, *(cells(x, " A") for x in AMPS[1:]), *(cells(x, " V") for x in VOLTS)]
    with pytest.raises(DataRefused, match="another unit than its column"):
        read(tmp_path, table(NAMES, columns))


def test_tables_of_the_same_times_are_one(tmp_path):
    time = cells(T, "")
    first = table(("Time (s)", "Ia", "Ib", "Ic"), [time, *(cells(x, "") for x in AMPS)])
    second = table(("Time (s)", "Vab", "Vbc", "Vca"), [time, *(cells(x, "") for x in VOLTS)])
    seen = read(tmp_path, f"Currents\n{first}\nVoltages\n{second}")
    require_right(seen)
    assert "tables" in {note.code for note in seen.notes}


@pytest.mark.parametrize("change", ["later", "fewer", "again"])
def test_tables_of_other_times_or_the_same_channels_are_not(tmp_path, change):
    time = {"later": T + 0.3 / RATE_HZ, "fewer": T[:-5], "again": T}[change]
    names = ("Time (s)", "Ia", "Ib", "Ic") if change == "again" else ("Time (s)", "Vab", "Vbc", "Vca")
    first = table(("Time (s)", "Ia", "Ib", "Ic"), [cells(T, ""), *(cells(x, "") for x in AMPS)])
    second = table(names, [cells(time, ""), *(cells(x[: time.size], "") for x in VOLTS)])
    with pytest.raises(DataRefused):
        read(tmp_path, first + second)


@pytest.mark.parametrize(
    ("names", "encoding"),
    [
        ("[s] Time;[A] Ia;[A] Ib;[A] Ic;[V] Vab;[V] Vbc;[V] Vca", "utf-8"),
        ("Time - s;Ia - A;Ib - A;Ic - A;Vab - V;Vbc - V;Vca - V", "utf-8"),
        ("t.s;iu.A;iv.A;iw.A;uuv.V;uvw.V;uwu.V", "utf-8"),
        ("Zeit s;I L1 A;I L2 A;I L3 A;U L1L2 V;U L2L3 V;U L3L1 V", "utf-8"),
        ("time_s;i.u;i.v;i.w;u.uv;u.vw;u.wu", "utf-8"),
        ("Messzeit;CH1 Ia;CH2 Ib;CH3 Ic;CH4 Vab;CH5 Vbc;CH6 Vca", "utf-8"),
        ("% t;Current L1 inst;Current L2 inst;Current L3 inst;Voltage L12 inst;Voltage L23 inst;Voltage L31 inst", "utf-8"),
        ("時刻[s];CH1 電流U[A];電流V[A];電流W[A];電圧U-V[V];電圧V-W[V];電圧W-U[V]", "cp932"),
        ("時間(秒);U相電流(安);V相電流(安);W相電流(安);UV線電壓(伏);VW線電壓(伏);WU線電壓(伏)", "big5"),
        ("시간(s);A상 전류(A);B상 전류(A);C상 전류(A);AB 선간전압(V);BC 선간전압(V);CA 선간전압(V)", "cp949"),
        ("Время, с;Ток фазы А, А;Ток фазы В, А;Ток фазы С, А;Напряжение АВ, В;Напряжение ВС, В;Напряжение СА, В", "cp1251"),
        ("Час, с;Струм фази A, А;Струм фази B, А;Струм фази C, А;Напруга AB, В;Напруга BC, В;Напруга CA, В", "cp1251"),
        ("Χρόνος (s);Ρεύμα A;Ρεύμα B;Ρεύμα C;Τάση AB;Τάση BC;Τάση CA", "cp1253"),
        ("Idő (s);Áram L1;Áram L2;Áram L3;Feszültség L12;Feszültség L23;Feszültség L31", "cp1250"),
        ("Timp;Curent faza R;Curent faza S;Curent faza T;Tensiune RS;Tensiune ST;Tensiune TR", "utf-8"),
        ("Tijd;Stroom L1;Stroom L2;Stroom L3;Lijnspanning L1-L2;Lijnspanning L2-L3;Lijnspanning L3-L1", "utf-8"),
        ("Tempo;Corrente da fase A;Corrente da fase B;Corrente da fase C;Tensão de linha AB;Tensão de linha BC;Tensão de linha CA", "utf-8"),
    ],
)  # fmt: skip
def test_names_of_others_are_read(tmp_path, names, encoding):
    columns = [cells(T, ""), *(cells(x, "") for x in (*AMPS, *VOLTS))]
    require_right(read(tmp_path, table(names.split(";"), columns), encoding=encoding))


def test_milliseconds_in_cyrillic_behind_a_comma_are_milliseconds(tmp_path):
    names = "Время, мс;Ток фазы А, мА;Ток фазы В, мА;Ток фазы С, мА;Напряжение АВ, В;Напряжение ВС, В;Напряжение СА, В"
    columns = [cells(T, "", 1e3), *(cells(x, "", 1e3) for x in AMPS), *(cells(x, "") for x in VOLTS)]
    require_right(read(tmp_path, table(names.split(";"), columns), encoding="cp1251"))


def test_a_time_for_every_channel_is_one_time_where_they_agree(tmp_path):
    names = [name for channel in NAMES[1:] for name in (f"t {channel}", channel)]
    apart = T + 0.4 / RATE_HZ
    for times in ([T] * 6, [T, apart, *[T] * 4]):
        pairs = zip(times, (*AMPS, *VOLTS), strict=True)
        text = table(names, [cells(x, "") for pair in pairs for x in pair])
        if times[1] is apart:
            with pytest.raises(DataRefused, match="two times"):
                read(tmp_path, text)
        else:
            require_right(read(tmp_path, text))


def test_a_text_called_dat_is_read_as_one(tmp_path):
    require_right(read(tmp_path, "# " + table(NAMES, [cells(x, "") for x in (T, *AMPS, *VOLTS)], " "), "x.dat"))


def test_stamps_with_a_date_give_the_mean_period(tmp_path):
    stamps = [f"2024-03-05T10:11:{12 + t:07.4f}Z" for t in T]
    require_right(read(tmp_path, table(NAMES, [stamps, *(cells(x, "") for x in (*AMPS, *VOLTS))])))


@pytest.mark.parametrize(
    ("name", "meaning", "unit"),
    [
        ("Voltage U V", "voltage_uv_v", ""),
        ("V.A", "voltage_u_v", ""),
        ("Current A", "current_u_a", ""),
        ("CH1 A", None, ""),
        ("i_t", "current_w_a", ""),
        ("T Ia [°C]", None, "°C"),
        ("I1 - V", None, ""),
    ],
)
def test_letters_that_are_a_phase_are_no_unit(name, meaning, unit):
    assert meaning_of(name) == meaning
    assert unit_of(name) == unit


def test_a_phase_in_each_unit_s_place_is_found_in_company():
    assert meanings_of(["Current (A)", "Current (B)", "Current (C)"]) == {
        "Current (A)": "current_u_a", "Current (B)": "current_v_a", "Current (C)": "current_w_a"}  # fmt: skip


def test_the_cells_of_a_plain_file_are_not_looked_at_for_units(monkeypatch):
    """Each line's cells, asked one by one, took twenty times as long as reading the file."""

    def looked(*_):
        raise AssertionError("a plain line was split")

    monkeypatch.setattr("commissioner.recordings.sheets.united.split", looked)
    rows = "".join(f"{k * 1e-4:.6e};{-1.5e-3 * k};{k}D-3;nan\n" for k in range(50))
    text = f"# motor 2.2 kW\nTime (ms);Ia (mA);Va (V);x\n{rows}"
    assert united(text.partition("\n")[2], "plain") == text.partition("\n")[2]
