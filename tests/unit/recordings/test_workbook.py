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


@pytest.mark.parametrize("above", [False, True])
def test_a_summary_of_formulas_without_values_is_left_out_and_the_rest_read(tmp_path: Path, above: bool) -> None:
    mean = [["Mean", "=AVERAGE(B3:B4)", "=AVERAGE(C3:C4)", "=AVERAGE(D3:D4)", ""]]
    rows = [*mean, *TESTS] if above else [*TESTS, *mean]
    path = workbook(tmp_path / "x.xlsx", Tests=rows, Chart=[["Peak", "=MAX(Tests!B2:B3)"]])
    assert contract_table(path).columns["voltage_line_v"].tolist()[:2] == [208.0, 25.0]


@pytest.mark.parametrize(
    "rows", [[TESTS[0], ["No load", "=200+8", 8.17, 0.42, 60], TESTS[2]], [["Test", "=B9", "I (A)", "P (kW)", "f (Hz)"], *TESTS[1:]],
             [TESTS[0], ["No load", "=200+8", "=8", "=1", "=60"], ["Locked", "=1", "=2", "=3", "=4"]], [["P_N [kW]", "U_N [V]"], ["=11", "=400"]]],
)  # fmt: skip
def test_a_table_of_formulas_without_values_is_refused(tmp_path: Path, rows: list[list[object]]) -> None:
    with pytest.raises(DataRefused, match="holds formulas whose values were not stored"):
        contract_table(workbook(tmp_path / "x.xlsx", Tests=rows))


ODS = (
    '<office:document-content xmlns:office="urn:oasis:names:tc:opendocument:xmlns:office:1.0" xmlns:table="urn:oasis:names:tc:opendocument:'
    'xmlns:table:1.0" xmlns:text="urn:oasis:names:tc:opendocument:xmlns:text:1.0" office:version="1.2"><office:body><office:spreadsheet>'
    '<table:table table:name="S1">{}</table:table></office:spreadsheet></office:body></office:document-content>'
)


def opendocument(path: Path, rows: list[list[object]]) -> Path:
    def cell(value: object) -> str:
        if isinstance(value, str) and value.startswith("="):
            return f'<table:table-cell table:formula="of:{value}"/>'
        kind = (
            f'office:value-type="float" office:value="{value}"'
            if not isinstance(value, str)
            else 'office:value-type="string"'
        )
        return f"<table:table-cell {kind}><text:p>{value}</text:p></table:table-cell>"

    body = "".join(f"<table:table-row>{''.join(map(cell, row))}</table:table-row>" for row in rows)
    with zipfile.ZipFile(path, "w") as packed:
        packed.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        packed.writestr("content.xml", '<?xml version="1.0" encoding="UTF-8"?>' + ODS.format(body))
        packed.writestr(
            "META-INF/manifest.xml",
            '<manifest:manifest xmlns:manifest="urn:oasis:names:tc:opendocument:xmlns:manifest:1.0"/>',
        )
    return path


def test_an_opendocument_is_read_and_one_of_formulas_refused(tmp_path: Path) -> None:
    path = opendocument(tmp_path / "x.ods", [*TESTS, ["Mean", "=AVERAGE([.B2:.B3])", "", "", ""]])
    assert contract_table(path).columns["voltage_line_v"].tolist()[:2] == [208.0, 25.0]
    with pytest.raises(DataRefused, match="formulas whose values were not stored"):
        contract_table(opendocument(tmp_path / "y.ods", [TESTS[0], TESTS[1], ["Locked", 25, "=27.9", 0.92, 60]]))


CSV = "time_s,current_u_a,current_v_a,voltage_u_v,voltage_v_v\n" + "".join(f"{k / 1000},1,2,3,{k}\n" for k in range(40))


@pytest.mark.parametrize(
    ("name", "says", "remedy"),
    [("a.zip", "a ZIP archive", "unpack it"), ("a.csv", "a ZIP archive", "unpack it"), ("a.numbers", "Apple Numbers", "Export To"),
     ("a.docx", "a text document", "CSV"), ("a.fods", "a flat OpenDocument", "XLSX"), ("a.npz", "arrays of NumPy", "CSV")],
)  # fmt: skip
def test_what_is_packed_is_named_and_never_read_as_a_text(tmp_path: Path, name: str, says: str, remedy: str) -> None:
    with zipfile.ZipFile(tmp_path / name, "w") as packed:
        packed.writestr("recording.csv", CSV)  # not compressed: its rows stand there as text
    with pytest.raises(DataRefused, match=says) as refused:
        contract_table(tmp_path / name)
    assert remedy in refused.value.remedy


@pytest.mark.parametrize(
    ("name", "begin", "says"),
    [("a.pdf", b"%PDF-1.4\n1,2\n3,4\n", "a PDF document"), ("a.csv", b"\x89PNG\r\n\x1a\n", "a picture"), ("a.dat2", b"\x93NUMPY\x01\x00", "NumPy"),
     ("a.xls", b"<html><table>", "an HTML page"), ("a.txt", b"\x1f\x8b\x08", "packed by gzip"), ("a.csv", b"PAR1\x15", "a Parquet file"),
     ("a.json", b"{}", "a JSON file"), ("a.xml", b"<?xml version='1.0'?>", "an XML file"), ("a.feather", b"ARROW1\0\0", "Feather")],
)  # fmt: skip
def test_a_file_is_known_by_its_first_bytes(tmp_path: Path, name: str, begin: bytes, says: str) -> None:
    (tmp_path / name).write_bytes(begin + CSV.encode())
    with pytest.raises(DataRefused, match=says):
        contract_table(tmp_path / name)


def test_a_workbook_of_another_name_is_asked_for_its_own_and_a_text_called_one_is_read(tmp_path: Path) -> None:
    workbook(tmp_path / "x.xlsx", Tests=TESTS).rename(tmp_path / "x.csv")
    with pytest.raises(DataRefused, match="a workbook by what it holds") as refused:
        contract_table(tmp_path / "x.csv")
    assert ".xlsx" in refused.value.remedy
    (tmp_path / "lab.xls").write_text(CSV.replace(",", "\t"), encoding="utf-8")
    assert contract_table(tmp_path / "lab.xls").columns["voltage_v_v"][-1] == 39.0
