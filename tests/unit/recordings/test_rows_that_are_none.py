"""Rows of a text that are no samples, and stamps that do not tell rows apart: left out and said, or refused."""

import re

import numpy as np
import pytest

from commissioner.errors import DataRefused
from commissioner.monitor.partial import Partial, without_plate
from commissioner.recordings.imported import understand
from commissioner.recordings.importers import contract_table, has_currents_only, read_running
from commissioner.recordings.reading.mend import require_one_block
from commissioner.recordings.table import Table, to_currents, to_standstill
from commissioner.records import UNUSED_VOLTAGE

NAMES = "Time (s),Ia (A),Ib (A),Ic (A),Va (V),Vb (V),Vc (V)"
STEP_S = 5e-4
TIME = np.arange(600) * STEP_S
WAVES = [np.cos(2 * np.pi * 50 * TIME - k * 2 * np.pi / 3) for k in range(3)]
SIGNALS = [*(4.2 * w for w in WAVES), *(325 * w for w in WAVES)]


def rows(stamps=None):
    stamps = [f"{t:.4f}" for t in TIME] if stamps is None else stamps
    return [",".join([stamp, *(f"{x[k]:.4f}" for x in SIGNALS)]).strip(",") for k, stamp in enumerate(stamps)]


def written(tmp_path, lines):
    path = tmp_path / "x.csv"
    path.write_text("\n".join(lines))
    return path


def read(path):
    """(the recording, the notes' codes, with every understanding of it made)"""
    with np.errstate(all="raise"):
        _, document = understand(path)
    return read_running(path), {note["code"] if isinstance(note, dict) else note.code for note in document["changes"]}


@pytest.mark.parametrize("header", [[NAMES], ["t,Ia,Ib,Ic,Va,Vb,Vc", "s,A,A,A,V,V,V"]])
def test_header_lines_among_the_countare_left_out(tmp_path, header):
    body = rows()
    recording, codes = read(written(tmp_path, [*header, *body[:250], *header, *body[250:]]))
    assert codes == {"header_again"} and recording.sample_period_s == pytest.approx(STEP_S)
    np.testing.assert_allclose(recording.currents_a[0], SIGNALS[0], atol=1e-4)


@pytest.mark.parametrize("between", [[], [",,,,,,"], [NAMES], ["", NAMES]])
@pytest.mark.parametrize(
    "first", [NAMES, "time_s,current_u_a,current_v_a,current_w_a,voltage_u_v,voltage_v_v,voltage_w_v"]
)
def test_a_second_recording_below_the_first_is_refused(tmp_path, between, first):
    between = [first if line == NAMES else line for line in between]
    with pytest.raises(DataRefused, match=r"begins again in row 601 of its numbers: 2 recordings") as refusal:
        read_running(written(tmp_path, [first, *rows(), *between, *rows()[:300]]))
    assert refusal.value.value == "from 0.2995 s back to 0 s" and "a file of its own" in refusal.value.remedy


def test_a_second_recording_that_goes_on_in_time_belongs_to_the_first(tmp_path):
    later = [f"{t + 0.3:.4f}" for t in TIME]
    assert read_running(written(tmp_path, [NAMES, *rows(), NAMES, *rows(later)])).time_s.size == 1200


def test_a_time_that_begins_again_in_each_segment_is_read():
    columns = {"time_s": np.tile(TIME, 2), "current_u_a": np.tile(SIGNALS[0], 2), "segment": np.repeat([0.0, 1.0], 600)}
    require_one_block(columns, "x")
    with pytest.raises(DataRefused, match="begins again"):
        require_one_block({**columns, "segment": np.zeros(1200)}, "x")


def test_header_lines_do_not_count_where_the_countmake_the_time(tmp_path):
    names, body = NAMES.partition(",")[2], rows([""] * TIME.size)
    recording, codes = read(
        written(tmp_path, ["# sample_period_s: 0.0005", names, *body[:250], names + ",", *body[250:]])
    )
    assert codes == {"header_again", "time_made"}
    np.testing.assert_allclose(recording.time_s, TIME, atol=1e-9)


@pytest.mark.parametrize(
    "footer", [["Min,-4,-4,-4,-325,-325,-325", "Max,4,4,4,325,325,325"], ["rms,3,3,3,230,230,230"]]
)
def test_statistics_below_the_countare_left_out(tmp_path, footer):
    recording, codes = read(written(tmp_path, [NAMES, *rows(), *footer]))
    assert codes == {"no_time"} and recording.time_s.size == 600
    assert recording.currents_a[0][-1] == pytest.approx(SIGNALS[0][-1], abs=1e-4)


def test_a_row_that_breaks_off_is_left_out(tmp_path):
    body = rows()
    recording, codes = read(written(tmp_path, [NAMES, *body[:-1], body[-1][:25]]))
    assert codes == {"torn_row"} and recording.time_s.size == 599


def test_a_short_row_inside_is_still_refused(tmp_path):
    body = rows()
    with pytest.raises(DataRefused, match="holds 4 columns"):
        read_running(written(tmp_path, [NAMES, *body[:300], body[300][:25], *body[301:]]))


def seconds_of_the_day():
    return rows([f"11:59:{58 + int(0.9 + t):02d}" for t in TIME])


def test_stamps_that_stand_still_are_refused_with_the_way_out(tmp_path):
    with pytest.raises(DataRefused, match="stands still") as refused:
        read_running(written(tmp_path, [NAMES, *seconds_of_the_day()]))
    assert refused.value.value == "2 different stamps in 600 rows, in steps of 1 s"


def test_stamps_that_stand_still_run_by_the_interval_that_the_file_gives(tmp_path):
    recording, codes = read(written(tmp_path, ["# sample_period_s: 0.0005", NAMES, *seconds_of_the_day()]))
    assert codes == {"time_made"} and recording.sample_period_s == STEP_S
    np.testing.assert_allclose(recording.time_s - recording.time_s[0], TIME, atol=1e-9)


def test_stamps_that_contradict_the_interval_of_the_file_are_refused(tmp_path):
    with pytest.raises(DataRefused, match="stands still"):
        read_running(written(tmp_path, ["# sample_period_s: 0.5", NAMES, *seconds_of_the_day()]))


def time_per_channel(skew_s, scale=1.0):
    """Voltages behind a time of their own, which is that of the currents shifted and scaled."""
    names = "Time (s),Ia (A),Ib (A),Ic (A),Time (s),Va (V),Vb (V),Vc (V)"
    own = [f"{scale * t + skew_s:.5f}" for t in TIME]
    body = [row.split(",") for row in rows()]
    return [names, *(",".join([*row[:4], t, *row[4:]]) for row, t in zip(body, own, strict=True))]


def test_a_time_per_channel_that_is_skewed_is_refused(tmp_path):
    with pytest.raises(
        DataRefused, match=r"Time \(s\) \(column 1\) and Time \(s\) \(column 5\) are two times, 0.00025 s apart"
    ) as refused:
        read_running(written(tmp_path, time_per_channel(STEP_S / 2)))
    assert refused.value.value == "0.5 of a sample period"


@pytest.mark.parametrize(("skew_s", "scale"), [(0.0, 1.0), (36000.0, 1.0), (0.0, 2000.0)])
def test_the_same_time_again_or_one_from_another_zero_is_left_out(tmp_path, skew_s, scale):
    recording, codes = read(written(tmp_path, time_per_channel(skew_s, scale)))
    assert codes == {"second_column"}
    np.testing.assert_allclose(recording.time_s, TIME, atol=1e-9)


@pytest.mark.parametrize("volts", [0.0, -540.0])
def test_a_link_without_voltage_is_no_drives(volts):
    """A drive that makes a voltage has one: the column is another signal, or its scale is lost."""
    count = 40
    columns = {
        name: np.zeros(count) for name in ("segment", "axis_deg", "voltage_axis_v", "current_u_a", "current_v_a")
    }
    table = Table(columns | {"time_s": np.arange(count) * 2e-4, "dc_link_v": np.full(count, volts)}, {}, "x.csv")
    with pytest.raises(DataRefused, match="dc_link_v is no DC link's voltage"):
        to_standstill(table)


@pytest.mark.parametrize(
    ("names", "values", "said"),
    [
        ("Va (V),Vb (V),Vc (V)", "n/a", "from Va (V), Vb (V), Vc (V): no numbers"),
        ("Spg. links (V),Spg. Mitte (V),Spg. rechts (V)", "1.5", "Spg. rechts (V): not named by a phase"),
    ],
)
def test_voltages_that_could_not_be_read_are_named(tmp_path, names, values, said):
    head = NAMES.replace("Va (V),Vb (V),Vc (V)", names)
    currents = [row.split(",")[1:4] for row in rows()] * 4
    lines = [",".join([f"{k * STEP_S:.4f}", *cells, *[values] * 3]) for k, cells in enumerate(currents)]
    table = contract_table(written(tmp_path, [head, *lines]))
    assert has_currents_only(table) and said in next(n.what for n in table.notes if n.code == UNUSED_VOLTAGE)
    seen = without_plate(to_currents(table))
    assert isinstance(seen, Partial) and said in seen.withheld["power_w"]


def test_a_voltage_without_numbers_is_named_where_the_others_do_not_suffice(tmp_path):
    lines = [",".join([*row.split(",")[:6], "n/a"]) for row in rows()]
    with pytest.raises(DataRefused, match="lacks three phase voltages") as refusal:
        read_running(written(tmp_path, [NAMES, *lines]))
    assert "no cell of Vc (V) is a number" in refusal.value.value


@pytest.mark.parametrize(
    ("names", "told"),
    [(NAMES, r"no voltages could be read from Va \(V\), Vb"), (NAMES.partition(",Va")[0], "current_w_a$")],
)
def test_parameters_of_currents_alone_are_refused_for_want_of_voltages(tmp_path, names, told):
    lines = [
        ",".join([stamp, *cells[:3], "n/a", "n/a", "n/a"][: names.count(",") + 1])
        for stamp, *cells in (row.split(",") for row in rows())
    ]
    with pytest.raises(DataRefused, match="holds no voltages") as refused:
        to_standstill(contract_table(written(tmp_path, [names, *lines])))
    assert re.search(told, str(refused.value.value))


@pytest.mark.parametrize("said", ["inf", "-inf"])
def test_an_infinite_number_is_a_missing_sample_and_is_said(tmp_path, said):
    """It went on as 1.8e308 A: numpy's warnings on the screen, and a state of `nan A`."""
    body = rows()
    cells = body[100].split(",")
    body[100] = ",".join([cells[0], said, *cells[2:]])
    header = "time_s,current_u_a,current_v_a,current_w_a,voltage_u_v,voltage_v_v,voltage_w_v"
    recording = read_running(written(tmp_path, [header, *body]))
    assert "infinite" in {note.code for note in recording.notes} and np.isnan(recording.currents_a[0][100])
    assert np.isfinite(np.delete(recording.currents_a[0], 100)).all()
