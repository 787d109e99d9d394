"""Other people's files: decimal commas, unit rows, MATLAB structures, and names in several languages."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from commissioner.errors import DataRefused, UsageError
from commissioner.recordings.imported import OF_NO_USE, understand
from commissioner.recordings.importers import import_table, read_running
from commissioner.recordings.names import meaning_of

DATA = Path(__file__).parents[2] / "data"
TIME = np.arange(400) * 1.25e-4
CHANNELS = [np.cos(2 * np.pi * 50 * TIME - k * 2 * np.pi / 3) for k in range(3)]


@pytest.mark.parametrize(
    ("name", "meaning"),
    [
        ("Ia", "current_u_a"),
        ("i_L2", "current_v_a"),
        ("Strom W", "current_w_a"),
        ("I1 (mA)", "current_u_a"),
        ("ib_A", "current_v_a"),
        ("vc_V", "voltage_w_v"),
        ("U12", "voltage_uv_v"),
        ("vab", "voltage_uv_v"),
        ("u_L1", "voltage_u_v"),
        ("van", "voltage_u_v"),
        ("Spannung V", "voltage_v_v"),
        ("V31 [V]", "voltage_wu_v"),
        ("t_s", "time_s"),
        ("Time (ms)", "time_s"),
        ("data.ib", "current_v_a"),
        ("speed", "speed_rad_per_s"),
        ("theta_e_rad", None),
        ("temperature", None),
        ("U13", None),
        ("I_S", "current_v_a"),
        ("current_v_a", "current_v_a"),
        ("voltage_wu_v", "voltage_wu_v"),
        ("U_ST", "voltage_vw_v"),
        ("stator_current_b", "current_v_a"),
        ("phase_voltage_c", "voltage_w_v"),
        ("voltage_A", "voltage_u_v"),
        ("current_A", "current_u_a"),
        ("Phase A current [A]", "current_u_a"),
        ("StatorCurrentB", "current_v_a"),
        ("U L1-L2 [V]", "voltage_uv_v"),
        ("I L3 [A]", "current_w_a"),
        ("Voltage_CA", "voltage_wu_v"),
        ("speed_rpm", "speed_rad_per_s"),
        ("is", None),
        ("motor temperature", None),
        ("Vn (V)", None),
        ("In (A)", None),
        ("U_N [V]", None),
        ("Vneutral (V)", None),
        ("Vbn (V)", "voltage_v_v"),
        ("VSN", "voltage_v_v"),
        ("Zeitstempel", "time_s"),
        ("voltage", None),
        ("N°", None),
        ("n°.", None),
        ("Nº", None),
        ("n", "speed_rad_per_s"),
    ],
)
def test_column_names_are_understood(name: str, meaning: str | None) -> None:
    assert meaning_of(name) == meaning


def write_oscilloscope(path: Path, encoding: str = "latin-1") -> None:
    """Semicolons, decimal commas, a preface, names, a unit row; time in ms and currents in mA."""
    lines = [
        "Gerät;XY-100",
        "Kommentar: Pumpe 3;;;;;;",
        "Zeit;Strom U;Strom V;Strom W;U_L1;U_L2;U_L3",
        "(ms);(mA);(mA);(mA);(V);(V);(V)",
    ]
    for k, t in enumerate(TIME):
        row = [t * 1e3, *(5e3 * c[k] for c in CHANNELS), *(325 * c[k] for c in CHANNELS)]
        lines.append(";".join(f"{x:.6f}".replace(".", ",") for x in row))
    path.write_bytes("\r\n".join(lines).encode(encoding))


@pytest.mark.parametrize("encoding", ["latin-1", "utf-8", "utf-16"])
def test_oscilloscope_csv_with_decimal_commas_and_unit_row(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "scope.csv"
    write_oscilloscope(path, encoding)
    recording = read_running(path)
    assert recording.sample_period_s == pytest.approx(1.25e-4)
    for k in range(3):
        np.testing.assert_allclose(recording.currents_a[k], 5 * CHANNELS[k], atol=1e-8)
        np.testing.assert_allclose(recording.voltages_v[k], 325 * CHANNELS[k], atol=1e-5)


def test_tab_separated_with_units_in_the_names_and_packed(tmp_path: Path) -> None:
    path = tmp_path / "log.csv.gz"
    head = "time (s)\tIa [A]\tIb [A]\tIc [A]\tUab [kV]\tUbc [kV]\tUca [kV]"
    rows = [
        "\t".join(f"{x:.7f}" for x in (t, *(c[k] for c in CHANNELS), *(0.4 * c[k] for c in CHANNELS)))
        for k, t in enumerate(TIME)
    ]
    path.write_bytes(gzip.compress("\n".join([head, *rows]).encode()))
    recording = read_running(path)
    assert recording.voltages_are_line_to_line
    np.testing.assert_allclose(recording.voltages_v[1], 400 * CHANNELS[1], atol=1e-3)


def test_matlab_structure_with_a_sample_rate(tmp_path: Path) -> None:
    path = tmp_path / "rec.mat"
    savemat(
        path,
        {
            "rec": {
                "fs": 8000.0,
                "ia": CHANNELS[0],
                "ib": CHANNELS[1],
                "ic": CHANNELS[2],
                "va": 325 * CHANNELS[0],
                "vb": 325 * CHANNELS[1],
                "vc": 325 * CHANNELS[2],
                "note": "x",
            }
        },
    )
    recording = read_running(path)
    assert recording.sample_period_s == pytest.approx(1.25e-4)
    np.testing.assert_allclose(recording.currents_a[2], CHANNELS[2])


def test_the_contract_s_own_csv_passes_through(tmp_path: Path) -> None:
    path = tmp_path / "own.csv"
    names = ["time_s", "current_u_a", "current_v_a", "current_w_a", "voltage_u_v", "voltage_v_v", "voltage_w_v"]
    rows = [
        ",".join(f"{x:.9g}" for x in (t, *(c[k] for c in CHANNELS), *(c[k] for c in CHANNELS)))
        for k, t in enumerate(TIME)
    ]
    path.write_text("# pole_pairs: 2\n" + ",".join(names) + "\n" + "\n".join(rows) + "\n")
    assert import_table(path).metadata["pole_pairs"] == 2.0


def test_a_single_channel_is_refused_with_what_is_missing() -> None:
    with pytest.raises(DataRefused, match=r"lacks time .* phase u, v, w, three phase voltages"):
        read_running(DATA / "acs712_motor" / "healthy_motor_data.csv")


@pytest.mark.parametrize(
    ("suffix", "name"),
    [
        (".mdf", "MDF 3"),
        (".xlsx", "Excel"),
        (".ods", "OpenDocument"),
        (".xls", "Excel"),
        (".tdms", "TDMS"),
        (".mf4", "MDF 4"),
        (".cff", "COMTRADE"),
    ],
)
def test_formats_that_are_not_read_or_damaged_are_named(tmp_path: Path, suffix: str, name: str) -> None:
    path = tmp_path / f"file{suffix}"
    path.write_bytes(b"x" * 100)
    with pytest.raises(DataRefused, match=name):
        read_running(path)


@pytest.mark.parametrize("content", [b"", b"\x00\x01\x02" * 50, b"hello\nworld\n", b"a;b\n1;x\n2;y\n"])
@pytest.mark.parametrize("suffix", [".csv", ".mat", ".csv.gz", ".parquet"])
def test_files_that_are_no_recordings_are_refused(tmp_path: Path, content: bytes, suffix: str) -> None:
    path = tmp_path / f"junk{suffix}"
    path.write_bytes(content)
    with pytest.raises(DataRefused):
        read_running(path)


def test_a_missing_file_is_a_usage_error(tmp_path: Path) -> None:
    with pytest.raises(UsageError):
        read_running(tmp_path / "none.csv")


def test_units_in_the_names_count_in_a_plain_comma_csv_too(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    head = "Time (ms),Ia (mA),Ib (mA),Ic (mA),Uab (kV),Ubc (kV),Uca (kV)"
    rows = [
        ",".join(f"{x:.7f}" for x in (1e3 * t, *(1e3 * c[k] for c in CHANNELS), *(0.4 * c[k] for c in CHANNELS)))
        for k, t in enumerate(TIME)
    ]
    path.write_text("\n".join([head, *rows]))
    recording = read_running(path)
    assert recording.sample_period_s == pytest.approx(1.25e-4)
    np.testing.assert_allclose(recording.currents_a[0], CHANNELS[0], atol=1e-6)
    np.testing.assert_allclose(recording.voltages_v[0], 400 * CHANNELS[0], atol=1e-4)


@pytest.mark.parametrize("header", ["index,time_s,ia,ib,ic,va,vb,vc", "ia,ib,ic,va,vb,vc"])
def test_names_and_columns_that_do_not_count_alike_are_refused(tmp_path: Path, header: str) -> None:
    """Read from the left every channel would be its neighbour's."""
    path = tmp_path / "log.csv"
    path.write_text("\n".join([f"# sample_period_s: 1\n{header}", *(f"{k},1,2,3,4,5,6" for k in range(20))]))
    with pytest.raises(DataRefused, match="columns than are named") as refused:
        read_running(path)
    assert refused.value.value == f"{header.count(',') + 1} names over 7 numbers"


@pytest.mark.parametrize("first", ["", ","])
def test_a_row_of_labels_names_the_columns_whether_a_cell_stands_below_its_key_or_not(
    tmp_path: Path, first: str
) -> None:
    path = tmp_path / "trace.csv"
    head = '"TraceName","Ia","Ib","Ic","Uab","Ubc","Uca"\n"VUnit","mA","mA","mA","V","V","V"\n"SampleRate",8000,8000,8000,8000,8000,8000\n"HUnit","s","s","s","s","s","s"\n\n'
    rows = [first + ",".join(f"{1e3 * c[k]:.7f}" for c in (*CHANNELS, *CHANNELS)) for k in range(len(TIME))]
    path.write_text(head + "\n".join(rows))
    recording = read_running(path)
    np.testing.assert_allclose(recording.currents_a[0], CHANNELS[0], atol=1e-6)
    np.testing.assert_allclose(recording.currents_a[1], CHANNELS[1], atol=1e-6)


def test_a_file_that_says_nothing_of_a_motor_is_told_what_to_do_about_it(tmp_path: Path) -> None:
    (tmp_path / "unnamed.csv").write_text("a,b\n1,2\n3,4\n", "utf-8")
    (tmp_path / "named.csv").write_text("time_s,voltage_uv_v\n0,2\n1,4\n", "utf-8")
    unnamed, named = (understand(tmp_path / name)[1]["changes"] for name in ("unnamed.csv", "named.csv"))
    assert OF_NO_USE in unnamed and OF_NO_USE not in named
    assert "--map" in OF_NO_USE.what
