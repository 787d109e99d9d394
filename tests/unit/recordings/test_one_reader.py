"""One recording under the headers that instruments' manuals show comes as the same numbers, or with a question."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from commissioner.errors import ConfigurationError, DataRefused, UsageError
from commissioner.motor.computed import is_negative_sum
from commissioner.recordings.imported import store, understand
from commissioner.recordings.importers import contract_table, read_running
from commissioner.recordings.reading.mapping import read_mapping
from commissioner.recordings.reading.mend import with_whole_time
from commissioner.recordings.table import to_standstill

RATE_HZ = 2000.0
TIME = np.arange(600) / RATE_HZ
RNG = np.random.default_rng(7)
CURRENTS = [
    4.2 * np.cos(2 * np.pi * 50 * TIME - 0.6 - k * 2 * np.pi / 3) + 0.02 * RNG.standard_normal(TIME.size)
    for k in range(3)
]
V = [325 * np.cos(2 * np.pi * 50 * TIME - k * 2 * np.pi / 3) + 0.5 * RNG.standard_normal(TIME.size) for k in range(3)]


def rows(time, signals, decimals=4, separator=",", comma=False, quoted=False, end=""):
    """The body as an instrument prints it."""
    out = []
    for values in zip(time, *signals, strict=True):
        cells = [f"{x:.{decimals}f}" for x in values]
        cells = [c.replace(".", ",") for c in cells] if comma else cells
        out.append(separator.join(f'"{c}"' if quoted else c for c in cells) + end)
    return "\n".join(out) + "\n"


def lines(*head):
    return "\n".join(head) + "\n"


UV, VW, WU = V[0] - V[1], V[1] - V[2], V[2] - V[0]
NAMED = [*CURRENTS, *V]
ABC = "Ia,Ib,Ic,Va,Vb,Vc"
FILES = {
    "picoscope": lines("Time,Ia,Ib,Ic,Va,Vb,Vc", "(ms),(mA),(mA),(mA),(V),(V),(V)", "")
    + rows(1e3 * TIME, [*(1e3 * x for x in CURRENTS), *V]),
    "picoscope microseconds": lines("Time,Ia,Ib,Ic,Va,Vb,Vc", "(µs),(A),(A),(A),(kV),(kV),(kV)", "")
    + rows(1e6 * TIME, [*CURRENTS, *(1e-3 * x for x in V)], 6),
    "rigol": lines(f"X,{ABC},Start,Increment,", "Sequence,A,A,A,V,V,V,-1.0e-01,5.000000e-04,")
    + rows(np.arange(600), NAMED, 5, end=",,"),
    "siglent": lines(
        "Record Length,Analog:600", "Sample Interval,Analog:0.0005", "Horizontal Units,s", "Model Number,SDS1104X-E",
        "Source," + ABC, "Second,A,A,A,Volt,Volt,Volt",
    )
    + rows(TIME, NAMED),
    "tektronix": lines(
        "Model,MSO46", "Waveform Type,ANALOG", "Horizontal Units,s", "Sample Interval,5e-04", "Record Length,600",
        "Probe Attenuation,1,1,1,1,1,1", "Vertical Units,A,A,A,V,V,V", ",,,,,,", "TIME," + ABC,
    )
    + rows(TIME, NAMED),
    "keysight": lines("x-axis," + ABC, "second,Ampere,Ampere,Ampere,Volt,Volt,Volt") + rows(TIME, NAMED),
    "rohde": lines("in s,Ia in A,Ib in A,Ic in A,Va in V,Vb in V,Vc in V") .replace("in s,", "Time in s,") + rows(TIME, NAMED),
    "german": lines("Zeit in ms;" + ";".join(f"Strom L{k} in A" for k in (1, 2, 3)) + ";"
                    + ";".join(f"Spannung L{k} in V" for k in (1, 2, 3)))
    + rows(1e3 * TIME, NAMED, separator=";", comma=True),
    "french": lines("Temps (s);Courant L1 (A);Courant L2 (A);Courant L3 (A);Tension L1 (V);Tension L2 (V);Tension L3 (V)")
    + rows(TIME, NAMED, separator=";", comma=True),
    "quoted": lines('"time_s","current_u_a","current_v_a","current_w_a","voltage_u_v","voltage_v_v","voltage_w_v"')
    + rows(TIME, NAMED, comma=True, quoted=True),
    "stator names": lines("t\tias\tibs\tics\tvas\tvbs\tvcs") + rows(TIME, NAMED, separator="\t"),
    "stator letters": lines("t,isa,isb,isc,usa,usb,usc") + rows(TIME, NAMED),
    "chinese": lines("时间(s),A相电流(A),B相电流(A),C相电流(A),A相电压(V),B相电压(V),C相电压(V)") + rows(TIME, NAMED),
    "russian": lines("Время, с;" + ";".join(f"{q} {p}, {u}" for q, u in (("Ток", "А"), ("Напряжение", "В")) for p in "ABC"))
    + rows(TIME, NAMED, separator=";", comma=True),
    "polish": lines("Czas [ms];" + ";".join(f"{q} L{k} [{u}]" for q, u in (("Prąd", "A"), ("Napięcie", "V")) for k in (1, 2, 3)))
    + rows(1e3 * TIME, NAMED, separator=";", comma=True),
    "japanese": lines("時間(s)," + ",".join(f"{p}相{q}" for q in ("電流(A)", "電圧(V)") for p in "UVW")) + rows(TIME, NAMED),
    "turkish": lines("Zaman (s);" + ";".join(f"{q} L{k} ({u})" for q, u in (("Akım", "A"), ("Gerilim", "V")) for k in (1, 2, 3)))
    + rows(TIME, NAMED, separator=";", comma=True),
    "colours": lines("Time,IR,IY,IB,VRN,VYN,VBN", "s,A,A,A,V,V,V") + rows(TIME, NAMED),
    "colours of phases": lines("Time (s),Current Phase R (A),Current Phase Y (A),Current Phase B (A),V_R (V),V_Y (V),V_B (V)")
    + rows(TIME, NAMED),
    "a neutral before the phases": lines("Time (s),Vn (V),In (A),Ia (A),Ib (A),Ic (A),Va (V),Vb (V),Vc (V)")
    + rows(TIME, [0.001 * V[0], 0.001 * V[1], *NAMED]),
    "names between semicolons": lines("Time (s);" + ABC.replace(",", ";")) + rows(TIME, NAMED),
    "across midnight": lines("Zeitstempel," + ABC)
    + "".join(f"{'23:59:59' if k < 300 else '00:00:00'}.{(8500 + round(t * 1e4)) % 10000:04d}," + ",".join(f"{x[k]:.4f}" for x in NAMED)
              + "\n" for k, t in enumerate(TIME)),
    "minus signs": lines("Time (s)," + ABC) + rows(TIME, NAMED).replace("-", "\u2212"),
    "swiss": lines("Zeit [us];" + ";".join(f"I{k} [mA]" for k in (1, 2, 3)) + ";" + ";".join(f"U{k} [V]" for k in (1, 2, 3)))
    + "".join(";".join([f"{t:,.0f}".replace(",", "'"), *(f"{1e3 * x[k]:,.1f}".replace(",", "\u2019") for x in CURRENTS),
                        *(f"{x[k]:.4f}" for x in V)]) + "\n" for k, t in enumerate(1e6 * TIME)),
    "rate in the preface": lines("Sampling rate: 2 kS/s", "", "I_U [A];I_V [A];I_W [A];U_L1 [V];U_L2 [V];U_L3 [V]")
    + "\n".join(";".join(f"{x:.4f}" for x in r) for r in zip(*NAMED, strict=True)) + "\n",
    "clock times": lines("Time," + ABC)
    + "".join(f"10:00:00.{round(t * 1e4):04d}," + ",".join(f"{x[k]:.4f}" for x in NAMED) + "\n" for k, t in enumerate(TIME)),
}  # fmt: skip
ENCODINGS = {
    "chinese": "gbk",
    "stator names": "utf-16",
    "german": "cp1252",
    "french": "latin-1",
    "picoscope microseconds": "cp1252",
    "russian": "cp1251",
    "polish": "cp1250",
    "japanese": "shift_jis",
    "turkish": "cp1254",
}


@pytest.mark.parametrize("name", FILES)
def test_the_same_recording_comes_from_every_header(tmp_path: Path, name: str) -> None:
    path = tmp_path / "file.csv"
    path.write_bytes(FILES[name].encode(ENCODINGS.get(name, "utf-8")))
    recording = read_running(path)
    assert recording.sample_period_s == pytest.approx(1 / RATE_HZ, rel=1e-6)
    for k in range(3):
        np.testing.assert_allclose(recording.currents_a[k], CURRENTS[k], atol=1e-4)
        np.testing.assert_allclose(recording.voltages_v[k], V[k], atol=1e-3)


def test_colours_of_line_voltages_and_what_midnight_is_said_to_be(tmp_path: Path) -> None:
    path = tmp_path / "file.csv"
    path.write_text(lines("Time (s),IR,IY,IB,VRY,VYB,VRB") + rows(TIME, [*CURRENTS, UV, VW, -WU]))
    recording = read_running(path)
    assert recording.voltages_are_line_to_line
    np.testing.assert_allclose(recording.voltages_v[2], WU, atol=1e-3)
    path.write_text(FILES["across midnight"])
    table = contract_table(path)
    np.testing.assert_allclose(table.columns["time_s"], 86399.85 + TIME, atol=1e-6)
    assert [note.what for note in table.notes] == [
        "the time of day passes midnight in 1 places: 24 h were added behind each"
    ]


def test_two_wattmeters_give_the_third_voltage_with_its_sign(tmp_path: Path) -> None:
    path = tmp_path / "analyser.csv"
    path.write_text(lines("Time (s),Ia (A),Ib (A),Uac (V),Ubc (V)") + rows(TIME, [CURRENTS[0], CURRENTS[1], -WU, VW]))
    recording = read_running(path)
    np.testing.assert_allclose(recording.voltages_v[2], WU, atol=1e-3)
    np.testing.assert_allclose(recording.voltages_v[1], VW, atol=1e-3)


@pytest.mark.parametrize("unit", ["MA", "V", "%", "counts"])
def test_a_unit_that_may_change_the_current_by_a_factor_is_refused(tmp_path: Path, unit: str) -> None:
    path = tmp_path / "file.csv"
    path.write_text(lines(f"Time (s),Ia ({unit}),Ib (A),Ic (A),Va (V),Vb (V),Vc (V)") + rows(TIME, NAMED))
    with pytest.raises(DataRefused, match="unit"):
        read_running(path)


def test_numbers_that_may_be_thousands_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "file.csv"
    signals = [np.round(3 + x, 3) + 0.0 for x in (0.1 * CURRENTS[0], 0.1 * CURRENTS[1], 0.1 * CURRENTS[2])]
    path.write_text(lines("Zeit\tIa\tIb\tIc") + rows(1 + TIME, signals, 3, "\t", comma=True))
    with pytest.raises(DataRefused, match="thousands"):
        contract_table(path)


def test_decimal_commas_between_commas_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "file.csv"
    path.write_text(lines("Time," + ABC) + rows(TIME, NAMED, comma=True))
    with pytest.raises(DataRefused, match="decimal commas between commas"):
        read_running(path)


CHANNELS = lines("Time,CH1,CH2,CH3,CH4,CH5,CH6", "(s),(V),(V),(V),(V),(V),(V)") + rows(
    TIME, [*(0.1 * x for x in CURRENTS), *V], 6
)
MEANS = ("current_u_a * 10", "current_v_a * 10", "current_w_a * 10", "voltage_u_v", "voltage_v_v", "voltage_w_v")


def test_channels_without_names_are_asked_for_and_a_mapping_answers(tmp_path: Path) -> None:
    path, mapping = tmp_path / "scope.csv", tmp_path / "map.toml"
    path.write_text(CHANNELS)
    with pytest.raises(DataRefused) as refusal:
        read_running(path)
    assert "--map" in refusal.value.remedy
    mapping.write_text("[columns]\n" + "".join(f'CH{k} = "{m}"\n' for k, m in enumerate(MEANS, 1)))
    mapped = read_running(path, read_mapping(mapping))
    said = tmp_path / "said.csv"
    said.write_text("".join(f"# CH{k}: {m}\n" for k, m in enumerate(MEANS, 1)) + CHANNELS)
    for recording in (mapped, read_running(said)):
        np.testing.assert_allclose(recording.currents_a[1], CURRENTS[1], atol=1e-4)
        np.testing.assert_allclose(recording.voltages_v[2], V[2], atol=1e-4)


@pytest.mark.parametrize(
    "text", ["[columns]\nCH1 = 'torque'\n", "[rows]\n", "no toml", "[columns]\nCH1 = 'current_u_a * -0'\n"]
)
def test_a_mapping_that_cannot_be_used_is_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "map.toml"
    path.write_text(text)
    with pytest.raises(ConfigurationError):
        read_mapping(path)
    with pytest.raises(UsageError):
        read_mapping(tmp_path / "none.toml")


def test_stamps_printed_short_become_the_mean_step_and_it_is_said(tmp_path: Path) -> None:
    path = tmp_path / "file.csv"
    body = rows(TIME, NAMED)
    short = "".join(
        f"{np.floor(1e3 * t) / 1e3:.3f},{line.split(',', 1)[1]}\n"
        for t, line in zip(TIME, body.splitlines(), strict=True)
    )
    path.write_text(lines("Time," + ABC) + short)
    recording = read_running(path)
    assert recording.sample_period_s == pytest.approx(1 / RATE_HZ, rel=1e-4)
    assert [note.code for note in recording.notes] == ["rounded_time"]


@pytest.mark.parametrize(
    ("rate_hz", "start_s", "shown"),
    [(4000.0, 0.0, ".4f"), (4000.0, 9.5, ".6g"), (8000.0, 0.0, ".4f"), (3000.0, 0.0, ".4f"), (12000.0, 98.0, ".6g")],
)
def test_stamps_rounded_to_a_part_of_the_period_become_the_mean_step(rate_hz, start_s, shown) -> None:
    """Six digits are what many programs print unasked: 4 kHz was refused from 10 s on, as of unequal steps, and 0.1 ms from the first."""
    time = start_s + np.arange(8000) / rate_hz
    stamps = np.array([float(f"{t:{shown}}") for t in time])
    columns, notes = with_whole_time({"time_s": stamps})
    assert [note.code for note in notes] == ["rounded_time"] and "share" not in notes[0].what * (rate_hz <= 8000.0)
    assert np.ptp(np.diff(columns["time_s"])) < 1e-9 and columns["time_s"] == pytest.approx(time, abs=5e-5)
    assert np.mean(np.diff(columns["time_s"])) == pytest.approx(1.0 / rate_hz, rel=1e-4)


@pytest.mark.parametrize("period_s", [4e-4, 2.5e-4, 1e-3, 2e-3, 1.25e-4, 1e-4 / 3.0])
def test_even_and_jittered_stamps_stay_as_they_are(period_s) -> None:
    """What is printed in whole digits is no rounding, and steps uneven by more than the last digit are the clock's."""
    even = np.array([float(f"{period_s * k:.9g}") for k in range(2000)])
    jittered = even + np.round(0.4 * period_s * np.random.default_rng(1).random(2000), 8)
    gap = np.where(np.arange(2000) < 900, even, even + 3.0 * period_s)
    for time in (even, jittered, gap):
        columns, notes = with_whole_time({"time_s": time})
        assert notes == [] and columns["time_s"] is time


def test_rows_written_twice_are_taken_once_and_it_is_said(tmp_path: Path) -> None:
    path = tmp_path / "file.csv"
    body = rows(TIME, NAMED).splitlines(keepends=True)
    path.write_text(lines("Time," + ABC) + "".join(body[:100] + body[99:300] + body[299:]))
    recording = read_running(path)
    assert recording.time_s.size == TIME.size
    assert recording.notes[0].code == "doubled_rows" and recording.notes[0].what.startswith("2 rows")


HEADS = {
    "contract": ("time_s,segment,axis_deg,voltage_axis_v,current_u_a,current_v_a", 1.0),
    "names": ("Time (ms),segment,axis_deg,voltage_axis_v,Ia (mA),Ib (mA)", 1e3),
    "units": ("time_s [ms],segment,axis_deg,voltage_axis_v,current_u_a [mA],current_v_a [mA]", 1e3),
    "german": ("Zeit [ms],Abschnitt,Achse [Grad],Spannung Achse [V],Strom U [mA],Strom V [mA]", 1e3),
    "spanish": ("Tiempo (ms),Segmento,Eje (grados),Tensión eje (V),Corriente L1 (mA),Corriente L2 (mA)", 1e3),
    "words": ("Time,Segment no,Axis angle (°),Axis voltage (V),I_a,I_b", 1.0),
    "other case": ("Time_S,Segment,AXIS_DEG,Voltage_Axis_V,Current_U_A,Current_V_A", 1.0),
    "unit row": ("time_s,segment,axis_deg,voltage_axis_v,current_u_a,current_v_a\nms,,,V,mA,mA", 1e3),
}


@pytest.mark.parametrize("name", HEADS)
def test_standstill_recordings_come_from_the_same_headers(tmp_path: Path, name: str) -> None:
    head, scale = HEADS[name]
    path = tmp_path / "file.csv"
    zeros = np.zeros(TIME.size)
    path.write_text(
        lines(head) + rows(scale * TIME, [zeros, zeros + 60, V[0], scale * CURRENTS[0], scale * CURRENTS[1]])
    )
    recording = to_standstill(contract_table(path))
    assert recording.sample_period_s == pytest.approx(1 / RATE_HZ, rel=1e-6)
    np.testing.assert_allclose(recording.current_v_a, CURRENTS[1], atol=1e-4)
    assert set(recording.axis_deg) == {60.0}
    np.testing.assert_allclose(recording.voltage_axis_v, V[0], atol=1e-4)


@pytest.mark.parametrize("missing", ["u", "v", "w"])
def test_two_currents_at_standstill_are_enough_whichever_they_are(tmp_path: Path, missing: str) -> None:
    """v and w alone had been refused although u is the negative sum of theirs."""
    path = tmp_path / "file.csv"
    there = {p: CURRENTS[k] for k, p in enumerate("uvw") if p != missing}
    zeros = np.zeros(TIME.size)
    head = "time_s,segment,axis_deg,voltage_axis_v," + ",".join(f"current_{p}_a" for p in there)
    path.write_text(lines(head) + rows(TIME, [zeros, zeros + 60, V[0], *there.values()]))
    recording = to_standstill(contract_table(path))
    said = any(f"current_{missing}_a is not there" in note.what for note in recording.notes)
    assert said == (missing != "w") and recording.current_w_a is None
    left = -sum(there.values())
    np.testing.assert_allclose(recording.current_u_a, there.get("u", left), atol=2e-4)
    np.testing.assert_allclose(recording.current_v_a, there.get("v", left), atol=2e-4)


def test_a_running_recording_given_as_standstill_is_named(tmp_path: Path) -> None:
    path = tmp_path / "file.csv"
    path.write_text(FILES["picoscope"])
    with pytest.raises(DataRefused, match="running motor"):
        to_standstill(contract_table(path))


@pytest.mark.parametrize("form", [".4f", ".7g", ".9g"])
@pytest.mark.parametrize("gain", [1.0, 0.98])
def test_a_third_current_that_is_the_others_sum_is_no_sensor(form: str, gain: float) -> None:
    def printed(x):
        return np.array([float(format(v, form)) for v in x])

    u, v = gain * CURRENTS[0], CURRENTS[1]
    assert is_negative_sum(printed(u), printed(v), printed(-(u + v)))
    assert not is_negative_sum(printed(u), printed(v), printed(CURRENTS[2]))


def test_the_computed_third_is_left_out_of_a_standstill_recording_and_said(tmp_path: Path) -> None:
    path = tmp_path / "file.csv"
    zeros = np.zeros(TIME.size)
    path.write_text(
        lines(HEADS["contract"][0] + ",current_w_a")
        + rows(TIME, [zeros, zeros, V[0], CURRENTS[0], CURRENTS[1], -(CURRENTS[0] + CURRENTS[1])])
    )
    recording = to_standstill(contract_table(path))
    assert recording.current_w_a is None
    assert recording.notes[-1].what.startswith("third current computed from two")


def test_each_column_is_shown_with_the_unit_that_its_name_says(tmp_path: Path) -> None:
    path = tmp_path / "ours.csv"
    speed = 150.0 + 0.0 * TIME
    path.write_text(
        "time_s,current_u_a,current_v_a,current_w_a,voltage_u_v,voltage_v_v,voltage_w_v,speed_rad_per_s\n"
        + rows(TIME, [*CURRENTS, *V, speed])
    )
    _, document = understand(path)
    shown = {c["name"]: (c["unit"], c["factor"]) for c in document["columns"]}
    assert shown["speed_rad_per_s"] == ("rad/s", 1.0)
    assert shown["time_s"] == ("s", 1.0) and shown["current_u_a"] == ("A", 1.0) and shown["voltage_u_v"] == ("V", 1.0)


def test_what_was_imported_reads_the_same_and_keeps_what_was_changed(tmp_path: Path) -> None:
    path, out = tmp_path / "scope.csv", tmp_path / "out.csv"
    path.write_text(FILES["rigol"])
    table, document = understand(path)
    assert document["kind"] == "running" and document["phase_order"] == {"current": "u-v-w", "voltage": "u-v-w"}
    files = store(table, document, out)
    again = read_running(out)
    np.testing.assert_allclose(again.currents_a[0], CURRENTS[0], atol=1e-4)
    assert "Start and Increment" in again.metadata["import_changes"]
    assert "<img" in Path(files["picture"]).read_text("utf-8")


SHORT = ("X,Ia,Ib,Ic,Va,Vb,Vc,Start,Increment,", "Sequence,A,A,A,V,V,V,-1.0e-01,5.000000e-04,")
"""Oscilloscopes end their rows of numbers before the header's last names."""


@pytest.mark.parametrize(("head", "end"), [(SHORT, ","), (SHORT, ""), ([x.rstrip(",") for x in SHORT], "")])
def test_start_and_increment_stand_beyond_the_numbers(tmp_path: Path, head, end) -> None:
    path = tmp_path / "scope.csv"
    path.write_text(lines(*head) + rows(np.arange(600), NAMED, 5, end=end))
    recording = read_running(path)
    assert recording.sample_period_s == pytest.approx(5e-4)
    np.testing.assert_allclose(recording.currents_a[0], CURRENTS[0], atol=1e-4)


@pytest.mark.parametrize("head", [f"X,{ABC}\nSequence,A,A,A,V,V,V\n", f"Sample,{ABC}\n", f"X,{ABC}\n"])
def test_a_column_that_counts_rows_is_no_time(tmp_path: Path, head) -> None:
    path, body = tmp_path / "scope.csv", rows(np.arange(600), NAMED, 5)
    path.write_text(head + body)
    with pytest.raises(DataRefused, match=r"counts the rows|lacks time"):
        read_running(path)
    path.write_text("# sample_period_s: 0.0005\n" + head + body)
    assert read_running(path).sample_period_s == pytest.approx(5e-4)


def test_probes_that_the_file_names_are_said_and_not_applied(tmp_path: Path) -> None:
    path = tmp_path / "scope.csv"
    path.write_text(lines("Probe,1:1,1:1,1:1,200:1,200:1,200:1", f"Time (s),{ABC}") + rows(TIME, NAMED))
    table, _ = understand(path)
    assert next(note.what for note in table.notes if note.code == "probes").startswith("probes of 200:1 are named")
    np.testing.assert_allclose(table.columns["voltage_u_v"], V[0], atol=1e-4)
    path.write_text(lines("Probe Attenuation,1,1,1,1,1,1", f"Time (s),{ABC}") + rows(TIME, NAMED))
    assert not any(note.code == "probes" for note in understand(path)[0].notes)


def test_a_file_of_circuit_values_alone_is_told_what_it_lacks(tmp_path):
    """It was asked for the columns of a standstill test, time_s first."""
    path = tmp_path / "circuit.csv"
    path.write_text("name,value\nR_s,1.32\nR_r,1.02\nL_m,0.168\n")
    with pytest.raises(DataRefused, match="no measurement is in this file") as refused:
        to_standstill(contract_table(path))
    assert "docs formats" in refused.value.remedy


def test_line_voltages_of_the_stator_are_read(tmp_path: Path) -> None:
    path = tmp_path / "file.csv"
    path.write_text(lines("t,isa,isb,usab,usbc") + rows(TIME, [*CURRENTS[:2], UV, VW]))
    recording = read_running(path)
    assert recording.voltages_are_line_to_line
    np.testing.assert_allclose(recording.voltages_v[0], UV, atol=1e-3)
