"""Tables drawn with bars, and names in further languages."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from commissioner.operations.recordings.identify import IdentifiedSheets, IdentifyRequest, identify_any
from commissioner.recordings.importers import contract_table

ROWS = [[f"{0.001 * k:.4f}", *(f"{np.cos(0.3 * k - p):.4f}" for p in range(6))] for k in range(40)]


def require_columns(tmp_path: Path, text: str) -> None:
    path = tmp_path / "recording.csv"
    path.write_text(text, encoding="utf-8")
    columns = contract_table(path).columns
    for k, name in enumerate(
        ("time_s", *(f"{kind}_{p}_{u}" for kind, u in (("current", "a"), ("voltage", "v")) for p in "uvw"))
    ):
        assert columns[name].tolist() == [float(row[k]) for row in ROWS]


def test_bars_separate_columns(tmp_path):
    names = ["t", "Ia", "Ib", "Ic", "Va", "Vb", "Vc"]
    require_columns(tmp_path, "\n".join("|".join(row) for row in [names, *ROWS]) + "\n")
    drawn = ["| " + " | ".join(row) + " |" for row in [names, *ROWS]]
    require_columns(tmp_path, "\n".join([drawn[0], "|---" * 7 + "|", *drawn[1:]]) + "\n")


@pytest.mark.parametrize(
    "words",
    [
        ("Čas", "Proud", "Napětí"),
        ("Tid", "Strøm", "Spænding"),
        ("Tid", "Ström", "Spänning"),
        ("Aika", "Virta", "Jännite"),
        ("tid", "strøm", "spenning"),
    ],
)
def test_common_words_of_further_languages(tmp_path, words):
    time, current, voltage = words
    names = [f"{time} [s]", *(f"{current} L{k} [A]" for k in (1, 2, 3)), *(f"{voltage} L{k} [V]" for k in (1, 2, 3))]
    require_columns(tmp_path, "\n".join(";".join(row) for row in [names, *ROWS]) + "\n")


def test_a_drawn_sheet_is_one(tmp_path):
    path = tmp_path / "sheet.md.csv"
    path.write_text(
        "| Test | f (Hz) | U (V) | I (A) | P (W) | R_uv (Ohm) |\n|---|---|---|---|---|---|\n| no load | 60 | 208 | 8.17 | 420 | 0.4857 |\n"
        "| locked rotor | 15 | 25 | 27.9 | 920 | 0.4857 |\n"
    )
    found = identify_any(IdentifyRequest((path,)))
    assert isinstance(found, IdentifiedSheets)
    assert found.document["parameters"]["rotor_resistance_ohm"]["value"] == pytest.approx(0.1514, rel=1e-3)
