"""Workbooks, written by another author's library: one table is read as its CSV export would be, everything else is refused by name."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import openpyxl
import pytest

from commissioner.errors import DataRefused
from commissioner.operations.recordings.identify import IdentifiedSheets, IdentifyRequest, identify_any
from commissioner.recordings.catalogue.reading import sheet_in
from commissioner.recordings.importers import contract_table, read_running

TESTS = [
    ["Test", "U (V)", "I (A)", "P (kW)", "f (Hz)"],
    ["No load", 208, 8.17, 0.42, 60],
    ["Locked rotor", 25, 27.9, 0.92, 15],
]
TRUTH = [0.2429, 0.1514, 3.484e-3, 35.11e-3]


def workbook(path: Path, **sheets: list[list[object]]) -> Path:
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        page = book.create_sheet(name)
        for row in rows:
            page.append(row)
    book.save(path)
    return path


def test_a_test_sheet_below_remarks_and_beside_a_cover(tmp_path: Path) -> None:
    rows = [["# R_uv (ohm): 0.4857"], [], *TESTS]
    path = workbook(tmp_path / "tests.xlsx", Cover=[["Motor", "M-17"], ["Date", 2026]], Tests=rows)
    done = identify_any(IdentifyRequest((path,)))
    assert isinstance(done, IdentifiedSheets)
    assert [q["value"] for q in done.document["parameters"].values()][:4] == pytest.approx(TRUTH, rel=1e-3)


def test_a_recording_comes_as_its_numbers(tmp_path: Path) -> None:
    time = np.arange(400) * 1e-3
    waves = [np.cos(2 * np.pi * 50 * time - k * 2 * np.pi / 3) for k in range(3)]
    columns = [time, *(4.2 * w for w in waves), *(325 * w for w in waves)]
    names = ["Time (s)", "Ia (A)", "Ib (A)", "Ic (A)", "Va (V)", "Vb (V)", "Vc (V)"]
    path = workbook(tmp_path / "run.xlsx", Log=[names, *(list(map(float, row)) for row in np.column_stack(columns))])
    read = read_running(path)
    assert np.allclose(read.currents_a, np.stack(columns[1:4]), rtol=0, atol=1e-12)


def test_a_makers_sheet(tmp_path: Path) -> None:
    rows = [["Rated power", 7.5, "kW"], ["Rated voltage", 400, "V"], ["Rated current", 14.7, "A"], ["Frequency", 50, "Hz"],
            ["Speed", 1455, "rpm"], ["Efficiency", 88.7, "%"], ["Power factor", 0.83], ["Locked rotor current", 7.2], ["Poles", 4]]  # fmt: skip
    found = sheet_in(workbook(tmp_path / "motor.xlsx", Data=rows))
    assert found is not None
    assert (found.get("rated_power_w"), found.values["rated_voltage_v"].printed) == (7500.0, "400 V")


def test_tables_on_several_sheets_are_asked_about(tmp_path: Path) -> None:
    path = workbook(tmp_path / "two.xlsx", Monday=TESTS, Tuesday=TESTS)
    with pytest.raises(DataRefused, match="holds tables on several sheets") as refused:
        contract_table(path)
    assert refused.value.value == "Monday, Tuesday"


@pytest.mark.parametrize("share", [0.02, 0.5, 0.98])
def test_a_torn_workbook_is_refused(tmp_path: Path, share: float) -> None:
    data = workbook(tmp_path / "x.xlsx", Tests=TESTS).read_bytes()
    (tmp_path / "torn.xlsx").write_bytes(data[: int(share * len(data))])
    with pytest.raises(DataRefused, match="no workbook that can be read"):
        contract_table(tmp_path / "torn.xlsx")


def test_changed_bytes_never_get_past_the_reader_as_anything_but_a_refusal(tmp_path: Path) -> None:
    data, random = workbook(tmp_path / "x.xlsx", Tests=TESTS).read_bytes(), np.random.default_rng(7)
    path = tmp_path / "changed.xlsx"
    for _ in range(60):
        piece = bytearray(data)
        for at in random.integers(0, len(piece), 8):
            piece[at] = random.integers(0, 256)
        path.write_bytes(piece)
        try:
            contract_table(path)
        except DataRefused as refused:
            assert refused.remedy


def test_a_workbook_that_unpacks_to_more_than_memory_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bomb.xlsx"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        packed.writestr("xl/worksheets/sheet1.xml", b" " * (80 << 20))
    with pytest.raises(DataRefused) as refused:
        contract_table(path)
    assert ">" in str(refused.value.value)
