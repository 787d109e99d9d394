"""What a file is by its first bytes, where that is nothing that is read, or something else than its name says."""

from __future__ import annotations

import zipfile
from pathlib import Path

from commissioner.errors import DataRefused
from commissioner.recordings.table import READ

EXPORT = "export the recording as CSV, XLSX or Parquet"
NAMED = {
    ".mdf": ("an MDF 3 file", EXPORT),
    ".h5": ("an HDF5 file", EXPORT),
    ".hdf5": ("an HDF5 file", EXPORT),
    ".toml": ("a TOML file", "give a nameplate by --motor, a mapping by --map, and the recording or the sheet as CSV"),
    ".numbers": ("a workbook of Apple Numbers", "in Numbers choose File, Export To, CSV or Excel"),
    ".doc": ("a text document", "copy the table out of it into a CSV file"),
    ".docx": ("a text document", "copy the table out of it into a CSV file"),
    ".odt": ("a text document", "copy the table out of it into a CSV file"),
    ".json": ("a JSON file", EXPORT),
    ".npz": ("arrays of NumPy", EXPORT),
    ".fods": ("a flat OpenDocument workbook", "save it as CSV, XLSX or ODS"),
}
"""What a file is by the ending of its name, and what to do."""
PACKED, OLE = b"PK\x03\x04", b"\xd0\xcf\x11\xe0"
BEGINS = {
    b"%PDF": ("a PDF document", "copy the table out of it into a CSV file"),
    b"\x89PNG": ("a picture", "export the numbers as CSV by the program that drew it"),
    b"\xff\xd8\xff": ("a picture", "export the numbers as CSV by the program that drew it"),
    b"GIF8": ("a picture", "export the numbers as CSV by the program that drew it"),
    b"\x89HDF": ("an HDF5 file", EXPORT),
    b"\x93NUMPY": ("an array of NumPy", EXPORT),
    b"ARROW1": ("an Arrow or Feather file", EXPORT),
    b"FEA1": ("a Feather file", EXPORT),
    b"SQLite format 3": ("a database of SQLite", EXPORT),
    b"{\\rtf": ("an RTF document", "save it as plain text, or the table as CSV"),
    b"7z\xbc\xaf": ("an archive of 7-Zip", "unpack it and give the recording in it"),
    b"Rar!": ("a RAR archive", "unpack it and give the recording in it"),
    b"<?xml": ("an XML file", EXPORT),
    b"<!doctype": ("an HTML page", "open it in a spreadsheet program and save it as CSV or XLSX"),
    b"<html": ("an HTML page", "open it in a spreadsheet program and save it as CSV or XLSX"),
    b"<table": ("an HTML page", "open it in a spreadsheet program and save it as CSV or XLSX"),
}
RENAMED = {
    b"\x1f\x8b": ("a file packed by gzip", ".gz"),
    b"PAR1": ("a Parquet file", ".parquet"),
    b"TDSm": ("a TDMS file", ".tdms"),
    b"MDF     4": ("an MDF 4 file", ".mf4"),
    b"MATLAB 5.0": ("a MATLAB file", ".mat"),
    OLE: ("an old Office file", ".xls"),
}
"""What is read under one ending only, and that ending."""
WORKBOOKS = {"xl/workbook.xml": ".xlsx", "xl/workbook.bin": ".xlsb", "content.xml": ".ods"}
HEAD = 4096


def require_kind(path: Path, endings: frozenset[str]) -> None:
    """DataRefused: the file is nothing that is read, or is named as something else; `endings`: those of workbooks."""
    suffix, head = path.suffix.lower(), _head(path)
    if suffix in NAMED:
        raise _refused(path, *NAMED[suffix])
    if suffix == ".mat":
        return
    for begin, (kind, remedy) in BEGINS.items():
        if head.lstrip(b"\xef\xbb\xbf \r\n\t").lower().startswith(begin.lower()):
            raise _refused(path, kind, remedy)
    for begin, (kind, ending) in RENAMED.items():
        if head.startswith(begin) and suffix != ending:
            raise _misnamed(path, kind, ending)
    if head.startswith(PACKED) and suffix not in endings:
        if (of_workbook := _packed_workbook(path)) is not None:
            raise _misnamed(path, "a workbook", of_workbook)
        raise _refused(path, "a ZIP archive", "unpack it and give the recording in it")


def is_text(path: Path) -> bool:
    """Whether a file holds lines of text: many instruments call theirs .xls."""
    head = _head(path)
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return True
    return not head.startswith((PACKED, OLE)) and b"\0" not in head and (b"\n" in head or b"\r" in head)


def _packed_workbook(path: Path) -> str | None:
    try:
        with zipfile.ZipFile(path) as packed:
            names = set(packed.namelist())
    except (zipfile.BadZipFile, OSError):
        return None
    return next((ending for member, ending in WORKBOOKS.items() if member in names), None)


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(HEAD)


def _refused(path: Path, kind: str, remedy: str) -> DataRefused:
    return DataRefused(
        f"{path}: this is {kind}, which is not read",
        step="read recording",
        value=path.suffix or "no ending",
        limit=READ,
        remedy=remedy,
    )


def _misnamed(path: Path, kind: str, ending: str) -> DataRefused:
    return DataRefused(
        f"{path}: this is {kind} by what it holds, and another by its name", step="read recording", value=path.suffix or "no ending",
        limit=f"the ending {ending}", remedy=f"let its name end with {ending}, or export it as CSV",
    )  # fmt: skip
