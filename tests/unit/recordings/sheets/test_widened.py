"""Long tables, a row for each time and channel, read as the same recording in columns."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from commissioner.errors import DataRefused
from commissioner.recordings.importers import contract_table
from commissioner.recordings.sheets import widened as widened_module
from commissioner.recordings.table import Table

TIMES = [f"{0.001 * k:.4f}" for k in range(60)]
NAMES = ("Ia", "Ib", "Ic", "Va", "Vb", "Vc")
COLUMNS = ("current_u_a", "current_v_a", "current_w_a", "voltage_u_v", "voltage_v_v", "voltage_w_v")
SAMPLES = [[f"{(10 if k < 3 else 300) * np.cos(0.3 * row - 2 * k):.3f}" for k in range(6)] for row in range(60)]


def read(tmp_path: Path, text: str) -> Table:
    path = tmp_path / "long.csv"
    path.write_text(text, encoding="utf-8")
    return contract_table(path)


def require_the_recording(table: Table) -> None:
    assert table.columns["time_s"] == pytest.approx(np.array(TIMES, float))
    for k, column in enumerate(COLUMNS):
        assert table.columns[column].tolist() == [float(row[k]) for row in SAMPLES]
    assert "long_table" in [note.code for note in table.notes]


@pytest.mark.parametrize("is_by_channel", [False, True])
@pytest.mark.parametrize(
    ("head", "form", "comma"),
    [
        ("time,channel,value", "{t},{n},{v}", False),
        ("Zeitstempel;Signal;Einheit;Wert", "{t};{n};{u};{v}", True),
        ("channel\ttime\tvalue\tquality", "{n}\t{t}\t{v}\tgood", False),
        ('"time","channel","value"', '"{t}","{n}","{v}"', True),
        ("# rated_power_w: 2200\ntime_s,variable,value", "{t},{c},{v}", False),
    ],
)
def test_a_long_table_is_the_recording(tmp_path, head, form, comma, is_by_channel):
    cells = [(row, k) for row in range(60) for k in range(6)]
    cells = sorted(cells, key=lambda cell: cell[1]) if is_by_channel else cells
    lines = [form.format(t=TIMES[r], n=NAMES[k], c=COLUMNS[k], u="AV"[k > 2], v=SAMPLES[r][k]) for r, k in cells]
    body = "\n".join(lines)
    require_the_recording(read(tmp_path, head + "\n" + (body.replace(".", ",") if comma else body) + "\n"))


def test_units_beside_the_channels_count(tmp_path):
    rows = [(TIMES[r], NAMES[k], "mA" if k < 3 else "kV", SAMPLES[r][k]) for r in range(60) for k in range(6)]
    table = read(tmp_path, "time;channel;unit;value\n" + "\n".join(map(";".join, rows)) + "\n")
    assert table.columns["current_v_a"] == pytest.approx([1e-3 * float(row[1]) for row in SAMPLES])
    assert table.columns["voltage_w_v"] == pytest.approx([1e3 * float(row[5]) for row in SAMPLES])


@pytest.mark.parametrize(
    ("head", "change", "says"),
    [
        ("time,channel,value,quality", lambda r, k: (TIMES[r], NAMES[k], SAMPLES[r][k], "bad" if r == 7 else "good"), "differ in quality"),
        ("time,channel,value", lambda r, k: (TIMES[r] + "5" * (k > 2), NAMES[k], SAMPLES[r][k]), "not stand at the same times"),
        ("time,channel,value,unit", lambda r, k: (TIMES[r], NAMES[k], SAMPLES[r][k], "mA" if r == 7 else "A"), "in two units"),
    ],
)  # fmt: skip
def test_channels_that_do_not_belong_together_are_refused(tmp_path, head, change, says):
    rows = [",".join(change(r, k)) for r in range(60) for k in range(6)]
    with pytest.raises(DataRefused, match=says):
        read(tmp_path, head + "\n" + "\n".join(rows) + "\n")


def test_points_and_tests_in_a_long_table_are_a_sheet(tmp_path):
    tests = {"no load": (60, 208, 8.17, 420, 0.4857), "locked rotor": (15, 25, 27.9, 920, 0.4857)}
    named = (("Frequency", "Hz"), ("Voltage", "V"), ("Current", "A"), ("Power", "W"), ("R_UV", "Ohm"))
    rows = [f"{t};{n};{u};{v}" for t, values in tests.items() for (n, u), v in zip(named, values, strict=True)]
    table = read(tmp_path, "Test;Quantity;Unit;Value\n" + "\n".join(rows) + "\n")
    assert table.columns["voltage_line_v"].tolist() == [208, 25] and table.columns["test"].tolist() == [1, 2]
    assert table.columns["winding_resistance_uv_ohm"].tolist() == [0.4857, 0.4857]


def test_a_wide_table_is_asked_no_more_than_its_head(tmp_path, monkeypatch):
    """Every line had been looked up: a recording with dates was read in 1.4 s instead of 0.1 s."""
    asked = []
    monkeypatch.setattr(widened_module, "key_of", lambda name: asked.append(name) or name)
    rows = "\n".join(f"01.02.2024;10:00:{k:06.3f};1.5;2.5" for k in range(300))
    assert widened_module.widened(f"Date;Time;Ia;Ib\n{rows}\n", "x") is None
    assert len(asked) < 20
