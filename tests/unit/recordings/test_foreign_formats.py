"""TDMS, MDF 4 and COMTRADE: files of other authors' writers, and the standard's own layout, come as what was recorded."""

import contextlib
import gzip
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from commissioner.errors import CommissionerError, DataRefused
from commissioner.recordings.formats import mdf4, tdms
from commissioner.recordings.importers import contract_table, import_table, read_running
from commissioner.recordings.table import write_table

DATA = Path(__file__).parents[2] / "data" / "foreign_formats"
TIME = np.arange(400) * 1.25e-4
WAVES = [np.cos(2 * np.pi * 50 * TIME - k * 2 * np.pi / 3) for k in range(3)]
FILES = ("logger.tdms", "logger.mf4", "zipped.mf4", "turned.mf4")


def assert_is_the_recording(recording, volts=0.06):
    assert recording.sample_period_s == pytest.approx(1.25e-4)
    for k, wave in enumerate(WAVES):
        np.testing.assert_allclose(recording.currents_a[k], 5 * wave, atol=1e-3)
        np.testing.assert_allclose(recording.voltages_v[k], 325 * wave, atol=volts)


@pytest.mark.parametrize("name", FILES)
def test_files_of_other_writers_come_in_si_units(name):
    assert_is_the_recording(read_running(DATA / name))


def test_a_linear_conversion_of_an_integer_channel_is_carried_out():
    np.testing.assert_allclose(mdf4.channels(DATA / "zipped.mf4")["raw_u [A]"], 5 * WAVES[0], atol=0.006)


def test_tdms_keeps_the_files_own_properties():
    _, metadata, _ = tdms.channels(DATA / "logger.tdms")
    assert metadata["operator"] == "x" and metadata["rated"] == 2.0


# --- COMTRADE ---------------------------------------------------------------------------------------------------------
AMPERES_PER_COUNT, VOLTS_PER_COUNT = 0.001, 0.01


def configuration(form, *, rate="8000,400", year=",1999", side="P", ratio="1,1"):
    currents = [f"{k + 1},I_L{k + 1},{'ABC'[k]},,A,{AMPERES_PER_COUNT},0,0,-9999,9999,{ratio},{side}" for k in range(3)]
    volts = [f"{k + 4},,{'ABC'[k]},,kV,{VOLTS_PER_COUNT / 1000},0,0,-99999,99999,1,1,P" for k in range(3)]
    rates = ["1", rate] if rate else ["0", "0,400"]
    dates = ["01/02/2026,10:00:00.000000", "01/02/2026,10:00:00.000000"]
    lines = [
        f"pump house,3{year}",
        "8,6A,2D",
        *currents,
        *volts,
        "1,trip,,,0",
        "2,run,,,0",
        "50",
        *rates,
        *dates,
        form,
        "1",
    ]
    return "\r\n".join(lines) + "\r\n"


def counts(sample):
    amperes = [round(5 * wave[sample] / AMPERES_PER_COUNT) for wave in WAVES]
    return amperes + [round(325 * wave[sample] / VOLTS_PER_COUNT) for wave in WAVES]


def samples(form):
    if form == "ASCII":
        rows = (f"{n + 1},{125 * n},{','.join(map(str, counts(n)))},0,1\r\n" for n in range(400))
        return "".join(rows).encode()
    kind = {"BINARY": "h", "BINARY32": "i", "FLOAT32": "f"}[form]
    return b"".join(struct.pack(f"<II6{kind}H", n + 1, 125 * n, *counts(n), 2) for n in range(400))


def write(folder, form, **options):
    (folder / "fault.cfg").write_bytes(configuration(form, **options).encode("latin-1"))
    (folder / "fault.dat").write_bytes(samples(form))
    return folder / "fault.cfg"


@pytest.mark.parametrize("form", ["ASCII", "BINARY32", "FLOAT32"])
@pytest.mark.parametrize("rate", ["8000,400", ""])
def test_comtrade_comes_in_si_units_with_the_names_or_phases_of_its_channels(tmp_path, form, rate):
    path = write(tmp_path, form, rate=rate)
    assert_is_the_recording(read_running(path), volts=0.01)
    assert_is_the_recording(read_running(path.with_suffix(".dat")), volts=0.01)


def test_sixteen_bits_and_the_marked_missing_sample(tmp_path):
    path = write(tmp_path, "BINARY")
    data = bytearray(b"".join(struct.pack("<II6hH", n, 0, *([n] * 6), 0) for n in range(400)))
    struct.pack_into("<h", data, 22 * 7 + 8, -0x8000)
    path.with_suffix(".dat").write_bytes(data)
    current = read_running(path).currents_a[0]
    assert np.flatnonzero(np.isnan(current)).tolist() == [7]
    assert current[9] == pytest.approx(9 * AMPERES_PER_COUNT)


def test_secondary_values_come_on_the_primary_side(tmp_path):
    recording = read_running(write(tmp_path, "ASCII", side="S", ratio="100,5"))
    np.testing.assert_allclose(recording.currents_a[0], 100 * WAVES[0], atol=0.02)


def test_a_single_file_comtrade(tmp_path):
    path = tmp_path / "fault.cff"
    parts = [b"--- file type: CFG ---\r\n", configuration("BINARY32", year=",2013").encode()]
    parts += [
        b"--- file type: INF ---\r\n",
        f"--- file type: DAT BINARY32: {len(samples('BINARY32'))} ---\r\n".encode(),
    ]
    path.write_bytes(b"".join([*parts, samples("BINARY32")]))
    assert_is_the_recording(read_running(path), volts=0.01)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [("8000,400", "8000,200", ""), ("6A", "999999A", "configuration"), ("BINARY32", "MORSE", "MORSE")],
)
def test_a_comtrade_that_contradicts_itself_is_refused_or_read_whole(tmp_path, old, new, says):
    path = write(tmp_path, "BINARY32")
    path.write_text(path.read_text().replace(old, new))
    if says:
        with pytest.raises(DataRefused) as caught:
            read_running(path)
        assert says in str(caught.value.value)
    else:
        assert_is_the_recording(read_running(path), volts=0.01)


@pytest.mark.parametrize("form", ["ASCII", "BINARY32"])
def test_a_rate_that_the_stamps_contradict_is_refused(tmp_path, form):
    with pytest.raises(DataRefused, match="two rates") as refused:
        read_running(write(tmp_path, form, rate="7680,400"))
    assert refused.value.value == "7680 Hz in the configuration, stamps at 8000 Hz"


def test_stamps_rounded_to_microseconds_do_not_contradict_the_rate(tmp_path):
    path = write(tmp_path, "ASCII", rate="1920,400")
    rows = [f"{n + 1},{round(n / 1.92e-3)},{','.join(map(str, counts(n)))},0,1" for n in range(400)]
    path.with_suffix(".dat").write_text("\r\n".join(rows))
    assert read_running(path).sample_period_s == pytest.approx(1.0 / 1920.0)


@pytest.mark.parametrize(("promised", "said"), [(600, True), (400, False), (0, False)])
def test_fewer_samples_than_the_configuration_promises_are_said(tmp_path, promised, said):
    notes = contract_table(write(tmp_path, "BINARY32", rate=f"8000,{promised}")).notes
    expected = "the configuration promises 600 samples, 400 are there: the end is lost"
    assert [note.what for note in notes if note.code == "fewer_samples"] == [expected] * said


def test_a_line_that_is_no_channel_is_named_with_what_was_promised(tmp_path):
    path = write(tmp_path, "BINARY32")
    path.write_text(
        "\n".join(line for line in path.read_text().splitlines() if not line.startswith(("6,", "1,trip", "2,run")))
    )
    with pytest.raises(DataRefused) as refused:
        contract_table(path)
    said = "configuration: line 8 (50) is no channel, where the second promises 6 analogue ones"
    assert refused.value.value == said


def test_a_missing_half_is_named(tmp_path):
    path = write(tmp_path, "ASCII")
    path.with_suffix(".dat").unlink()
    with pytest.raises(DataRefused, match=r"\.dat file is missing"):
        read_running(path)


# --- the contract's own names, and damage ------------------------------------------------------------------------------
def test_channels_with_the_contracts_names_pass_as_they_are(tmp_path):
    text = configuration("BINARY32")
    for k, name in enumerate(("segment", "axis_deg", "voltage_axis_v")):
        text = text.replace(f"{k + 4},,{'ABC'[k]},,kV", f"{k + 4},{name},,,")
    for k, name in enumerate(("current_u_a", "current_v_a", "current_w_a")):
        text = text.replace(f"I_L{k + 1}", name)
    (tmp_path / "own.cfg").write_text(text)
    (tmp_path / "own.dat").write_bytes(samples("BINARY32"))
    table = contract_table(tmp_path / "own.cfg")
    assert {"time_s", "segment", "axis_deg", "voltage_axis_v", "current_u_a"} <= set(table.columns)
    foreign = contract_table(DATA / "logger.tdms")
    assert {"time_s", "current_u_a", "current_v_a", "current_w_a"} <= set(foreign.columns)


@settings(max_examples=400, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@example("logger.tdms", 341, 16, False, False)  # a chunk longer than any array
@given(st.sampled_from(FILES), st.integers(0, 10**6), st.integers(1, 255), st.booleans(), st.booleans())
def test_a_damaged_file_gives_a_typed_error_or_a_recording(tmp_path, name, place, flip, is_cut, is_near_the_start):
    data = (DATA / name).read_bytes()
    place %= 2000 if is_near_the_start else len(data)
    path = tmp_path / name
    path.write_bytes(data[:place] if is_cut else data[:place] + bytes([data[place] ^ flip]) + data[place + 1 :])
    with contextlib.suppress(CommissionerError):
        import_table(path)


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 10**6), st.binary(max_size=4), st.sampled_from(["ASCII", "BINARY32"]), st.booleans())
def test_a_damaged_comtrade_gives_a_typed_error_or_a_recording(tmp_path, place, change, form, in_the_samples):
    path = write(tmp_path, form)
    target = path.with_suffix(".dat") if in_the_samples else path
    data = target.read_bytes()
    place %= len(data)
    target.write_bytes(data[:place] + change + data[place + len(change) + 1 :])
    with contextlib.suppress(CommissionerError):
        import_table(path)


@pytest.mark.parametrize(("separator", "comma"), [(";", True), (";", False), ("\t", True)])
@pytest.mark.parametrize("ending", [".csv", ".csv.gz"])
def test_standstill_tables_between_semicolons_or_tabs_are_the_same_table(tmp_path, separator, comma, ending):
    """Both verbs on standstill recordings read through `contract_table`; points tables keep columns of their own."""
    rows = [[k * 2e-4, 0.0, 60.0, 1.5 * k, 0.25 * k, -0.125 * k, 30.0 + k] for k in range(40)]
    names = "time_s,segment,axis_deg,voltage_axis_v,current_u_a,current_v_a,winding_degc"
    preface = "# rated_power_w: 2200\n# motor: a name\n"
    plain = tmp_path / "plain.csv"
    plain.write_text(preface + "\n".join([names, *(",".join(f"{x:.6f}" for x in row) for row in rows)]) + "\n")
    other = tmp_path / f"other{ending}"
    lines = [separator.join(f"{x:.6f}".replace(".", "," if comma else ".") for x in row) for row in rows]
    text = preface + "\n".join([names.replace(",", separator), *lines]) + "\n"
    other.write_bytes(gzip.compress(text.encode()) if ending.endswith(".gz") else text.encode())
    seen, wanted = contract_table(other), contract_table(plain)
    assert list(seen.columns) == list(wanted.columns)
    for name, values in wanted.columns.items():
        np.testing.assert_array_equal(seen.columns[name], values)
    assert dict(seen.metadata) == dict(wanted.metadata)


@pytest.mark.parametrize("lines", [2, 3, 5])
def test_a_comtrade_that_ends_early_says_where_and_what_it_promised(tmp_path, lines):
    whole = ["station,device,1999", "3,3A,0D", *(f"{k},i{k},{k},,A,0.001,0,0,-32767,32767,1,1,P" for k in (1, 2, 3))]
    (tmp_path / "x.cfg").write_text("\n".join(whole[:lines]) + "\n")
    (tmp_path / "x.dat").write_bytes(b"")
    with pytest.raises(DataRefused) as refused:
        contract_table(tmp_path / "x.cfg")
    assert (
        refused.value.value
        == f"configuration: cut short after line {lines}, where the second promises 3, 3A, 0D channels"
    )


@pytest.mark.parametrize("ending", [".csv", ".csv.gz", ".parquet", ".mat"])
def test_a_recording_of_ours_keeps_its_plate_through_every_form(tmp_path, ending):
    """Through MATLAB it came back without any: `--motor` was asked for, and a delta was none any more."""
    time = 2e-4 * np.arange(50)
    columns = {"time_s": time, "segment": 0 * time, "axis_deg": 0 * time}
    columns |= {name: np.round(np.sin(900 * time), 4) for name in ("voltage_axis_v", "current_u_a", "current_v_a")}
    plate = {
        "rated_power_w": 2200.0, "rated_voltage_v": 400.0, "rated_frequency_hz": 50.0, "rated_current_a": 5.0,
        "rated_speed_rpm": 1436.0, "power_factor": 0.8, "pole_pairs": 2.0, "connection": "delta", "sample_period_s": 2e-4,
    }  # fmt: skip
    path = tmp_path / f"a{ending}"
    write_table(path, columns, plate)
    table = contract_table(path)
    assert plate.items() <= table.metadata.items()
    for name, signal in columns.items():
        assert np.array_equal(table.columns[name], signal)
