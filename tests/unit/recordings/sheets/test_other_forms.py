"""Test sheets that give volts of a phase, the power of one, or a power factor, in tables and in lists; plates among the rows of lists."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from commissioner.errors import DataRefused
from commissioner.operations.recordings.identify import IdentifiedSheets, IdentifyRequest, identify_any
from commissioner.recordings.importers import contract_table

TRUE = [0.2429, 0.1514, 3.484e-3, 35.11e-3]
IDLE, LOCKED = 420 / (np.sqrt(3) * 208 * 8.17), 920 / (np.sqrt(3) * 25 * 27.9)
V0, VK = 208 / np.sqrt(3), 25 / np.sqrt(3)
TABLE = "test,f (Hz),U (V),I (A),{}\ndc,0,13.6,28,\nno load,60,208,8.17,{}\nlocked rotor,15,25,27.9,{}\n"
PLATE = "Rated power;5,5;kW\nRated voltage;208;V\nRated current;27,9;A\nRated frequency;60;Hz\nPower factor;0,82\n"
LIST = "U_0;208;V\nI_0;8,17;A\nP_0;420;W\nf_0;60;Hz\nU_k;25;V\nI_k;27,9;A\nP_k;0,92;kW\nf_k;15;Hz\nR_UV;485,7;mOhm\n"
WORDS = (
    "{1}No-load {2}voltage: {3:.4f} V\nNo-load current: 8.17 A\nNo-load power{4}: {5:.4f}{0}\nNo-load frequency: 60 Hz\n"
    "Locked-rotor {2}voltage: {6:.4f} V\nLocked-rotor current: 27.9 A\nLocked-rotor power{4}: {7:.4f}{0}\n"
    "Locked-rotor frequency: 15 Hz\nR_UV: 485.7 mOhm\n"
)
SHEETS = {
    "a power factor in a table": TABLE.format("cos phi", f"{IDLE:.4f}", f"{LOCKED:.4f}"),
    "per cent": TABLE.format("PF (%)", f"{100 * IDLE:.2f}", f"{100 * LOCKED:.2f}"),
    "beside watts": TABLE.replace("28,", "28,,").format("P (W),PF", "420,0.14", "920,0.76"),
    "watts of a phase": TABLE.format("P per phase (W)", "140", "306.667"),
    "a power factor down the rows": f"Quantity,DC,No-load,Locked rotor\nf [Hz],0,60,15\nU [V],13.6,208,25\nI [A],28.0,8.17,27.9\n"
    f"cos phi,,{IDLE:.4f},{LOCKED:.4f}\n",
    "a power factor in a list": WORDS.format("", "", "", 208, " factor", IDLE, 25, LOCKED),
    "phase volts in a list": WORDS.format(" W", "connection: star\n", "phase ", V0, "", 420, VK, 920),
    "volts to the neutral in a list": WORDS.format(" W", "", "line-to-neutral ", V0, "", 420, VK, 920),
    "words in one": f"Schaltung: Stern\nLeerlaufspannung (Strang);{V0:.3f};V\nLeerlaufstrom;8.17;A\nLeerlaufleistung;420;W\n"
    f"Leerlauffrequenz;60;Hz\nStrangspannung Kurzschluss;{VK:.4f};V\nKurzschlussstrom;27.9;A\nKurzschlussleistung;920;W\n"
    "Kurzschlussfrequenz;15;Hz\nR_UV;485.7;mOhm\n".replace("Leerlaufspannung (Strang)", "Strangspannung Leerlauf"),
    "symbols": f"# connection: star\nU0ph;I0;P0;f0;Uk_ph;Ik;cos φ_k;fk;R_UV [Ohm]\n{V0:.4f};8.17;420;60;{VK:.4f};27.9;{LOCKED:.4f};15;0.4857\n",
    "direct current between lines": f"connection: star\nUdc: 13.6 V\nIdc: 28 A\nU0ph: {V0:.4f} V\nI0: 8.17 A\nP0: 420 W\nf0: 60 Hz\n"
    f"Ukph: {VK:.4f} V\nIk: 27.9 A\nPk: 920 W\nfk: 15 Hz\n",
    "a plate among its rows": PLATE + LIST,
}


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "sheet.csv"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", SHEETS)
def test_a_sheet_gives_its_circuit_in_other_forms(tmp_path: Path, name: str) -> None:
    done = identify_any(IdentifyRequest((written(tmp_path, SHEETS[name]),)))
    assert isinstance(done, IdentifiedSheets)
    found = [q["value"] for q in done.document["parameters"].values()]
    assert found[:4] == pytest.approx(TRUE, rel=2e-3)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (WORDS.format(" W", "", "phase ", V0, "", 420, VK, 920), "voltage_phase_v may be of a winding or of a line"),
        (TABLE.format("cos phi", "14.3", "76"), "power_factor is 14.3 in row 2"),
        (
            TABLE.replace("28,", "28,,").format("P (W),PF", "140,0.14", "306.7,0.76"),
            "power_w of row 2 is a power factor of 0.0476",
        ),
        (
            TABLE.format("P per phase (W)", "140", "306.7").replace("locked", "single-phase locked"),
            "beside a single-phase test",
        ),
    ],
)
def test_a_form_that_may_be_another_is_asked_for(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(DataRefused, match=says):
        identify_any(IdentifyRequest((written(tmp_path, text),)))


def test_a_plate_among_the_rows_is_the_plate_and_no_points(tmp_path: Path) -> None:
    table = contract_table(written(tmp_path, PLATE + LIST))
    assert {table.metadata[k] for k in ("rated_power_w", "rated_voltage_v", "power_factor")} == {5500.0, 208.0, 0.82}
    assert "power_factor" not in table.columns and table.columns["power_w"].tolist() == [420.0, 920.0]
