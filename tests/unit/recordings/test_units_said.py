"""What a unit, a preface or a sign says of a value: taken, asked for, or said; a factor is never guessed."""

import numpy as np
import pytest

from commissioner.errors import DataRefused
from commissioner.recordings.catalogue.plate_said import plate_said
from commissioner.recordings.importers import contract_table
from commissioner.recordings.names import unit_of
from commissioner.recordings.units import read_unit

TIME = np.arange(40) * 2e-4
ONE, TWO = np.cos(2 * np.pi * 50 * TIME), np.sin(2 * np.pi * 50 * TIME)


def written(path, head, time, i=1.0, u=1.0):
    """A recording of two currents and two line voltages of 3 A and 300 V peak, printed times the factors."""
    rows = zip(time, 3 * i * ONE, 3 * i * TWO, 300 * u * ONE, 300 * u * TWO, strict=True)
    path.write_text(
        "\n".join([*head, *(",".join(c if isinstance(c, str) else f"{c:.9g}" for c in row) for row in rows)]) + "\n",
        encoding="utf-8",
    )
    return path


NAMED = "t,ia,ib,uab,ubc"
READ = {
    "words": (["Zeit (Millisekunden),Ia (milliamps),Ib (Milliampere),Uab (kilovolts),Ubc (kV)"], 1e3, 1e3, 1e-3),
    "words of French": (["Temps (microsecondes),ia (A),ib (A),uab (V),ubc (V)"], 1e6, 1.0, 1.0),
    "behind a comma": (['"t, ms","Ia, mA","Ib, mA","Uab, V","Ubc, V"'], 1e3, 1e3, 1.0),
    "behind a colon": (["t: ms,ia: mA,ib: mA,uab: V,ubc: V"], 1e3, 1e3, 1.0),
    "in braces": (["t {us},ia {mA},ib {mA},uab {mV},ubc {mV}"], 1e6, 1e3, 1e3),
    "small letters": (["time_ns,ia_ma,ib_ma,uab_kv,ubc_kv"], 1e9, 1e3, 1e-3),
    "once above the columns": (["Time unit: ms", "Current unit: mA", NAMED], 1e3, 1e3, 1.0),
    "of the horizontal axis": (["Horizontal Units,ms", NAMED], 1e3, 1.0, 1.0),
    "a remark in brackets": (["t (relative),Ia (phase A),Ib (phase B),Uab (line to line),Ubc (rms)"], 1.0, 1.0, 1.0),
    "an index that is part of the name": (['t,i_abc(1),i_abc(2),"V(a,b)","V(b,c)"'], 1.0, 1.0, 1.0),
    "a minus before the name": (["t,-Ia,\u2212Ib,Uab,Ubc"], 1.0, -1.0, 1.0),
    "German lines": (
        ["Zeit,Leiterstrom L1,Außenleiterstrom L2,Leiterspannung U12,Außenleiterspannung U23"], 1.0, 1.0, 1.0,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", READ)
def test_a_unit_that_is_said_is_taken(tmp_path, name):
    head, t, i, u = READ[name]
    columns = contract_table(written(tmp_path / "x.csv", head, t * TIME, i, u)).columns
    np.testing.assert_allclose(columns["time_s"], TIME, atol=1e-9)
    np.testing.assert_allclose(columns["current_u_a"], 3 * ONE, atol=1e-6)
    np.testing.assert_allclose(columns["current_v_a"], 3 * TWO, atol=1e-6)
    np.testing.assert_allclose(columns["voltage_uv_v"], 300 * ONE, atol=1e-4)
    np.testing.assert_allclose(columns["voltage_vw_v"], 300 * TWO, atol=1e-4)


@pytest.mark.parametrize("unit", ["dA", "10 A/V", "x10 A", "A/10", "m A", "inverted", "ampieri"])
def test_a_unit_that_is_not_known_is_asked_for(tmp_path, unit):
    path = written(tmp_path / "x.csv", [f"t,Ia ({unit}),Ib ({unit}),uab,ubc"], TIME)
    with pytest.raises(DataRefused, match="is none that is known") as refused:
        contract_table(path)
    assert unit in str(refused.value.value) and "--map" in refused.value.remedy
    head = [
        f"# Ia ({unit}): current_u_a * 10",
        f"# Ib ({unit}): current_v_a * 10",
        f"t,Ia ({unit}),Ib ({unit}),uab,ubc",
    ]
    np.testing.assert_allclose(contract_table(written(path, head, TIME)).columns["current_u_a"], 30 * ONE, atol=1e-6)


@pytest.mark.parametrize(
    "said", ["CT ratio: 100/5", "Scale,1,10,10,1,1", "Scaling factor current: 10", "Übersetzung;20"]
)
def test_a_factor_above_the_columns_is_said_and_not_applied(tmp_path, said):
    table = contract_table(written(tmp_path / "x.csv", [said.replace(";", ","), NAMED], TIME))
    (note,) = (n for n in table.notes if n.code == "factors")
    assert "taken as they are printed" in note.what and "map" in note.what
    np.testing.assert_allclose(table.columns["current_u_a"], 3 * ONE, atol=1e-6)


@pytest.mark.parametrize(
    "said", ["CT ratio: 1", "Scale,1,1.0,1,1,1", "Vertical Scale,2,2,2,200,200", "Time scale: linear"]
)
def test_a_factor_of_one_and_a_scopes_divisions_are_no_factor(tmp_path, said):
    table = contract_table(written(tmp_path / "x.csv", [said, NAMED], TIME))
    assert not any(n.code == "factors" for n in table.notes)


def test_stamps_and_an_interval_by_thousands_apart_are_asked_for(tmp_path):
    path = written(tmp_path / "x.csv", ["Sample Interval,0.0002", NAMED], 1e3 * TIME)
    with pytest.raises(DataRefused, match="milli or micro") as refused:
        contract_table(path)
    assert refused.value.value == "0.2 s a row" and refused.value.limit == "0.0002 s"


def test_stamps_of_every_fourth_sample_are_used_and_the_interval_said(tmp_path):
    table = contract_table(written(tmp_path / "x.csv", ["Sample Interval,0.00005", NAMED], TIME))
    (note,) = (n for n in table.notes if n.code == "interval")
    assert "step by 0.0002 s: the stamps are used" in note.what
    assert "sample_period_s" not in table.metadata
    table = contract_table(written(tmp_path / "y.csv", ["Sample Interval,0.0002", NAMED], TIME))
    assert not any(n.code == "interval" for n in table.notes)


def test_a_time_of_day_with_its_zone_is_read_and_one_that_is_none_is_refused(tmp_path):
    stamps = [f"2024-03-05T10:11:{12 + t:09.6f}+01:00" for t in TIME]
    time = contract_table(written(tmp_path / "x.csv", ["timestamp,ia,ib,uab,ubc"], stamps)).columns["time_s"]
    np.testing.assert_allclose(np.diff(time), 2e-4, atol=1e-6)
    never = [f"shot {k} of forty" for k in range(TIME.size)]
    with pytest.raises(DataRefused, match="no cell of the time column is a time"):
        contract_table(written(tmp_path / "y.csv", ["timestamp,ia,ib,uab,ubc"], never))


def test_phases_counted_from_zero_are_asked_for(tmp_path):
    path = tmp_path / "x.csv"
    rows = "\n".join(f"{t:.6f},{a:.5f},{b:.5f},{-a - b:.5f}" for t, a, b in zip(TIME, ONE, TWO, strict=True))
    path.write_text(f"t,i[0],i[1],i[2]\n{rows}\n")
    table = contract_table(path)
    assert not any(name.startswith("current_") for name in table.columns)
    assert sum(n.code == "unnamed_channel" for n in table.notes) == 3


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("Ia (mA)", "mA"),
        ("V(a,b)", ""),
        ("Ia (phase A)", ""),
        ("Time (hh:mm:ss.fff)", ""),
        ("U [kV]", "kV"),
        ("n in s", "s"),
    ],
)
def test_the_unit_of_a_name(name, unit):
    assert unit_of(name) == unit


def test_units_in_words():
    assert [read_unit(t).scale for t in ("milliseconds", "Mikrosekunden", "kilovolt", "Nanosekunden")] == [
        1e-3,
        1e-6,
        1e3,
        1e-9,
    ]


OURS = "time_s,current_u_a,current_v_a,voltage_uv_v,voltage_vw_v"
LINES = ["currents in mA", "all currents are in milliamperes, voltages in V", "Ströme in mA", "currents [mA]", "unit of current: mA",
         "Current unit: mA", "current: mA", "current_u_a in mA", "Les courants sont en mA", "corrientes: mA", "I in mA", "电流单位：mA"]  # fmt: skip


@pytest.mark.parametrize("line", LINES)
def test_a_line_that_contradicts_a_name_of_ours_is_refused_with_both(tmp_path, line):
    path = written(tmp_path / "x.csv", [f"# {line}", OURS], TIME, 1e3)
    with pytest.raises(DataRefused, match="current_u_a is in A by its name and in m") as refused:
        contract_table(path)
    said = [part.strip("` ") for part in refused.value.remedy.split("`") if part.startswith("# ")]
    assert len(said) == 2
    columns = contract_table(written(path, [f"# {line}", *said, OURS], TIME, 1e3)).columns
    np.testing.assert_allclose(columns["current_v_a"], 3 * TWO, atol=1e-6)


@pytest.mark.parametrize("line", LINES)
def test_a_line_gives_the_unit_of_names_without_one(tmp_path, line):
    table = contract_table(written(tmp_path / "x.csv", [f"# {line}", "t,ia,ib,uab,ubc"], TIME, 1e3))
    np.testing.assert_allclose(table.columns["current_u_a"], 3 * ONE, atol=1e-6)
    assert [note.what for note in table.notes if note.code == "unit_once"]
    other = contract_table(written(tmp_path / "x.csv", [f"# {line}", "t,Ia [A],Ib [A],uab,ubc"], TIME))
    np.testing.assert_allclose(other.columns["current_u_a"], 3 * ONE, atol=1e-6)
    assert [note.what[:12] for note in other.notes if note.code == "two_units"] == ["Ia [A] is in", "Ib [A] is in"]


@pytest.mark.parametrize(
    "line", ["currents in A, voltages in V", "rated current in mA: 4860", "no-load current [mA] 850", "trigger: current in phase u",
             "time in s", "currents in mA and currents in kA", "voltages of the supply in kiel", "Nennstrom (mA); 4860"],
)  # fmt: skip
def test_a_line_that_agrees_or_says_a_value_is_nothing_to_ask_about(tmp_path, line):
    for names in (OURS, NAMED):
        table = contract_table(written(tmp_path / "x.csv", [f"# {line}", names], TIME))
        np.testing.assert_allclose(table.columns["current_u_a"], 3 * ONE, atol=1e-6)
        assert not [note for note in table.notes if note.code in ("two_units", "unit_once") and "mA" in note.what]


@pytest.mark.parametrize(
    ("text", "says"),
    [("", "the file is empty"), ("\n \n", "the file is empty"), ("\ufeff", "the file is empty"),
     (OURS + "\n", "holds a header and no row of numbers"), ("Zeit;Ia;Ib\ns;A;A\n", "holds a header and no row of numbers"),
     ("# rated_power_w: 2200\n" + OURS, "holds a header and no row of numbers"), ("f [Hz];U [V];I [A];P [W]\n", "holds a header and no row"),
     ("Dear colleague,\nplease find attached\n", "no rows of numbers were found")],
)  # fmt: skip
def test_a_file_without_rows_says_why(tmp_path, text, says):
    (tmp_path / "x.csv").write_text(text, encoding="utf-8")
    with pytest.raises(DataRefused, match=says):
        contract_table(tmp_path / "x.csv")


@pytest.mark.parametrize(
    ("first", "second"),
    [("02/03/2026 23:59:59", "02/04/2026 00:00:00"), ("01/12/2026 23:59:59", "01/13/2026 00:00:00"), ("03.02.2026 23:59:59", "04.02.2026 00:00:00"),
     ("12/31/2025 23:59:59", "01/01/2026 00:00:00"), ("31/01/2026 23:59:59", "01/02/2026 00:00:00"), ("01/31/26 11:59:59 PM", "02/01/26 12:00:00 AM"),
     ("04/05/2026 10:00:00", "04/05/2026 10:00:01")],
)  # fmt: skip
def test_a_date_that_passes_midnight_has_its_day_where_one_second_passes(tmp_path, first, second):
    def stamps(k):
        date, clock, *half = (first if k < 20 else second).split(" ")
        return " ".join([date, f"{clock}.{(k % 20) * 50:03d}", *half])

    path = written(tmp_path / "x.csv", ["time,ia,ib,uab,ubc"], [stamps(k) for k in range(TIME.size)])
    np.testing.assert_allclose(np.diff(contract_table(path).columns["time_s"]), 0.05, atol=1e-5)


@pytest.mark.parametrize(
    ("unit", "printed", "celsius"), [("°F", 212.0, 100.0), ("degF", 32.0, 0.0), ("K", 293.15, 20.0), ("°C", 40.0, 40.0)]
)
def test_a_temperature_is_known_with_its_zero_and_is_no_time(tmp_path, unit, printed, celsius):
    known = read_unit(unit)
    assert known.measures == "temperature" and known.scale * printed + known.offset == pytest.approx(celsius)
    columns = contract_table(
        written(tmp_path / "x.csv", ["# sample_period_s: 0.0002", f"T [{unit}],ia,ib,uab,ubc"], 20 + TIME)
    ).columns
    assert columns["time_s"][1] == pytest.approx(2e-4)


@pytest.mark.parametrize("unit", ["r.p.m.", "[r.p.m.]", "R.P.M.", "rpm", "min⁻¹", "tr/min", "giri/min", "U/min"])
@pytest.mark.parametrize("name", ["Velocidad nominal", "Giri nominali", "Revoluciones nominales", "Nenndrehzahl"])
def test_the_plates_speed_is_read_with_what_counts_turns_a_minute(name, unit):
    """Of `r.p.m.` one dot was taken off, as of `kg.m²`: the plate lacked its speed."""
    said, notes = plate_said({name: f"1164 {unit}"}, "x.csv")
    assert said == {"rated_speed_rpm": 1164.0} and [n.code for n in notes] == ["plate_said"]
