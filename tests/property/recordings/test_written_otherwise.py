"""One recording in whatever way it is written: the same numbers, or a typed refusal; never other numbers."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from commissioner.errors import DataRefused
from commissioner.recordings.importers import contract_table
from commissioner.recordings.names import meanings_of

ROWS = 12
TIME = np.arange(ROWS) * 1e-3
MEANT = {
    "time_s": TIME,
    **{f"current_{p}_a": 2.5e3 * np.sin(314.0 * TIME - 2.1 * k + 0.1) for k, p in enumerate("uvw")},
    **{f"voltage_{p}_v": 5.6e3 * np.cos(314.0 * TIME - 2.1 * k + 0.1) for k, p in enumerate("uvw")},
}
WORDS = {"time": ["Time", "Zeit", "tiempo", "时间", "zaman"], "current": ["Current", "Strom", "corriente", "akım", "prąd", "ток", "außenleiterstrom"],
         "voltage": ["Voltage", "Spannung", "tensión", "gerilim", "napięcie", "напряжение"]}  # fmt: skip
UNITS = {
    "time": {"s": 1.0, "ms": 1e3, "µs": 1e6},
    "current": {"A": 1.0, "mA": 1e3, "kA": 1e-3},
    "voltage": {"V": 1.0, "kV": 1e-3},
}
MARKS = st.sampled_from(
    [(";", d, t) for d, t in ((",", ""), (",", "."), (",", " "), (",", "\u202f"), (",", "\u00a0"), (".", "'"), (".", ","), (".", ""))]
    + [("\t", ",", " "), ("\t", ".", "\u2009"), (",", ".", ""), (",", ".", "\u00a0"), (",", ".", " ")]
)  # fmt: skip


def number(value, marks):
    plain = f"{value:,.5f}"
    return plain.replace(",", "T").replace(".", marks[1]).replace("T", marks[2])


@settings(max_examples=60, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_however_it_is_written_it_holds_the_same_numbers(tmp_path, data):
    marks, phases = data.draw(MARKS), data.draw(st.sampled_from(["UVW", "ABC", "RST", "RYB", "123"]))
    names, cells = [], []
    for column in data.draw(st.permutations(list(MEANT))):
        quantity, phase = column.split("_")[:2]
        word = data.draw(st.sampled_from([str, str.upper, str.title]))(data.draw(st.sampled_from(WORDS[quantity])))
        unit, scale = data.draw(st.sampled_from(list(UNITS[quantity].items())))
        names.append(f"{word} {phases['uvw'.index(phase)] if phase in 'uvw' else ''} [{unit}]")
        cells.append([number(value * scale, marks) for value in MEANT[column]])
    end, encoding = (
        data.draw(st.sampled_from(["\n", "\r\n"])),
        data.draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16"])),
    )
    path = tmp_path / "a.csv"
    path.write_bytes(end.join(marks[0].join(row) for row in [names, *zip(*cells, strict=True)]).encode(encoding))
    try:
        read = contract_table(path).columns
    except DataRefused:
        return
    for column in read.keys() & MEANT.keys():
        np.testing.assert_allclose(read[column], MEANT[column], atol=0.02 if column != "time_s" else 2e-5)
    assert read.keys() >= MEANT.keys() or marks == (",", ".", " ")


def written(tmp_path, *cells, separator=";"):
    path = tmp_path / "a.csv"
    rows = [separator.join([f"{0.001 * k:.4f}".replace(".", ","), cell, "0,5"]) for k, cell in enumerate(cells)]
    path.write_text("\n".join([separator.join(["Zeit [s]", "Drehzahl [rpm]", "Ia [A]"]), *rows]))
    return path


def test_a_number_that_outgrows_its_head_is_not_a_thousandth(tmp_path):
    """Below 1000 for all rows by which the marks are told: then 1.010 would be read as 1.01."""
    with pytest.raises(DataRefused, match=r"1\.010 may be thousands"):
        contract_table(written(tmp_path, *["990"] * 250, "1.010"))


def test_both_marks_in_one_number_say_which_is_which(tmp_path):
    read = contract_table(written(tmp_path, *["990,5"] * 250, "1.010,5"))
    assert read.columns["speed_rad_per_s"][-1] == pytest.approx(1010.5 * np.pi / 30)


def test_points_of_decimals_are_no_thousands_beside_commas(tmp_path):
    """A point was taken out of `1.5` once another number had shown it between thousands: 15 was read."""
    with pytest.raises(DataRefused, match=r"1\.5 may be thousands"):
        contract_table(written(tmp_path, *["1.010,5"] * 20, "1.5"))


def test_commas_before_three_digits_beside_points_are_asked_for(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time_s;power_w;current_u_a\n" + "".join(f"0.{k:03d}5;1,234;0.5\n" for k in range(20)))
    with pytest.raises(DataRefused, match="1,234 may be thousands"):
        contract_table(path)


def test_a_cell_that_is_no_number_is_said(tmp_path):
    table = contract_table(written(tmp_path, *["990,5"] * 20, "99O,5"))
    assert [note.what for note in table.notes if note.code == "no_number"] == [
        "1 cells of Drehzahl [rpm] are no number, as '99O,5': they were left out"
    ]


@pytest.mark.parametrize(
    ("names", "meant"),
    [
        (["Current (A)", "Voltage (V)", "Ia (A)", "Vb (V)"], {"Ia (A)": "current_u_a", "Vb (V)": "voltage_v_v"}),
        (["Current (A)", "Current (B)"], {"Current (A)": "current_u_a", "Current (B)": "current_v_a"}),
        (["Voltage (U)", "Voltage (V)"], {"Voltage (U)": "voltage_u_v", "Voltage (V)": "voltage_v_v"}),
        (["Prąd R", "Prąd Y", "Prąd B"], {"Prąd R": "current_u_a", "Prąd Y": "current_v_a", "Prąd B": "current_w_a"}),
    ],
)  # fmt: skip
def test_a_unit_is_a_phase_only_in_company(names, meant):
    assert meanings_of(names) == meant
