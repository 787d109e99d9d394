"""However the stream is cut, the archive gives the same samples; whatever bytes lie there, errors are typed."""

import gzip
import io
import itertools
import json
import struct
import zlib

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pa_parquet
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from commissioner.errors import CommissionerError
from commissioner.procedure.assembly import assemble
from commissioner.recordings.table import read_table, to_standstill
from commissioner.records import SampleBlock
from commissioner.run.archive.blocks import read_blocks
from commissioner.run.archive.catalogue import read_runs
from commissioner.run.archive.folder import RunFolder
from commissioner.run.archive.journal import read_journal

FEW = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
PERIOD_S = 2e-4
SIGNALS = ("voltage_axis_v", "current_u_a", "current_v_a", "current_w_a")


def block(first: int, values: np.ndarray, lost: int = 0) -> SampleBlock:
    return SampleBlock(7, first, PERIOD_S, 60.0, *values, dc_link_v=540.0, lost_before=lost)


def cut(values: np.ndarray, places: list[int]) -> list[SampleBlock]:
    """The same samples in blocks that end at the places."""
    edges = sorted({0, values.shape[1], *(place % values.shape[1] for place in places)})
    return [block(a, values[:, a:b]) for a, b in itertools.pairwise(edges)]


@FEW
@given(st.integers(2, 120), st.lists(st.integers(0, 1000), max_size=12), st.integers(0, 2**32 - 1))
def test_however_the_stream_is_cut_archive_and_assembly_give_the_same_recording(tmp_path, count, places, seed):
    values = np.random.default_rng(seed).standard_normal((4, count))
    folder = RunFolder.create(tmp_path, "x")
    for piece in cut(values, places):
        folder.append(piece, 3)
    folder.close()
    seen = assemble(read_blocks(folder.path / "blocks.bin"), {}, "cut")
    whole = assemble([(3, block(0, values))], {}, "whole")
    for name in ("time_s", "segment", "axis_deg", *SIGNALS, "dc_link_v"):
        np.testing.assert_array_equal(getattr(seen, name), getattr(whole, name), strict=True)
    assert seen.sample_period_s == whole.sample_period_s


@FEW
@given(st.lists(st.integers(1, 40), min_size=1, max_size=6), st.integers(0, 5000), st.integers(0, 2**32 - 1))
def test_wherever_the_file_is_cut_off_the_blocks_before_are_whole(tmp_path, counts, kept, seed):
    rng = np.random.default_rng(seed)
    folder = RunFolder.create(tmp_path, "x")
    written, ends, first = [], [], 0
    path = folder.path / "blocks.bin"
    for count in counts:
        written.append(block(first, rng.standard_normal((4, count))))
        first += count
        folder.append(written[-1], 0)
        ends.append(path.stat().st_size)
    folder.close()
    path.write_bytes(path.read_bytes()[:kept])
    found = list(read_blocks(path))
    assert len(found) == sum(end <= kept for end in ends)
    for (_, seen), wanted in zip(found, written, strict=False):
        for name in SIGNALS:
            np.testing.assert_array_equal(getattr(seen, name), getattr(wanted, name))


def typed(act) -> object:
    """What `act` gives, or the CommissionerError it raises; anything else is a failure of the test."""
    try:
        return act()
    except CommissionerError as error:
        return error


@FEW
@given(st.binary(max_size=400))
def test_random_bytes_as_blocks_give_a_typed_error_or_nothing(tmp_path, data):
    path = tmp_path / "blocks.bin"
    path.write_bytes(data)
    typed(lambda: list(read_blocks(path)))


@FEW
@given(st.binary(max_size=200), st.sampled_from([None, 0, 2**32 - 1]))
def test_a_record_with_a_right_check_sum_and_wrong_content_gives_a_typed_error(tmp_path, payload, size):
    path = tmp_path / "blocks.bin"
    length = len(payload) if size is None else size
    path.write_bytes(struct.pack("<4sII", b"BLK1", length, zlib.crc32(payload)) + payload)
    typed(lambda: list(read_blocks(path)))


@FEW
@given(st.integers(0, 2**32 - 1), st.integers(0, 3), st.binary(max_size=300))
def test_a_header_that_does_not_fit_its_samples_gives_a_typed_error(tmp_path, count, flags, samples):
    payload = struct.pack("<IIIIIdddB", 0, 1, 0, count, 0, PERIOD_S, 0.0, 540.0, flags) + samples
    path = tmp_path / "blocks.bin"
    path.write_bytes(struct.pack("<4sII", b"BLK1", len(payload), zlib.crc32(payload)) + payload)
    typed(lambda: list(read_blocks(path)))


JSON = st.recursive(
    st.none() | st.booleans() | st.floats(allow_nan=False) | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)
LINES = st.one_of(
    st.binary(max_size=60),
    JSON.map(lambda value: json.dumps(value).encode()),
    st.tuples(st.sampled_from(["run_ended", "about_to", "state_entered", "drive_identified"]), JSON).map(
        lambda pair: json.dumps({"n": 0, "kind": pair[0], "record": pair[1]}).encode()
    ),
    st.sampled_from([b"[" * 100_000, b"1" * 5000, b'{"kind": 1}', b'{"kind": "x", "record": {}}', b"\xff\xfe", b"NaN"]),
)


@FEW
@given(st.lists(LINES, max_size=6))
def test_random_lines_as_a_journal_never_break_the_list_of_runs(tmp_path, lines):
    folder = tmp_path / "run"
    folder.mkdir(exist_ok=True)
    (folder / "journal.jsonl").write_bytes(b"\n".join(lines))
    assert isinstance(typed(lambda: read_journal(folder / "journal.jsonl")), list)
    assert len(typed(lambda: read_runs(tmp_path))) == 1


@FEW
@given(st.binary(max_size=400))
def test_a_torn_result_never_breaks_the_list_of_runs(tmp_path, data):
    folder = tmp_path / "run"
    folder.mkdir(exist_ok=True)
    (folder / "journal.jsonl").write_text("")
    (folder / "result.json").write_bytes(data)
    assert len(typed(lambda: read_runs(tmp_path))) == 1


HEADER = b"time_s,segment,axis_deg,voltage_axis_v,current_u_a,current_v_a\n"
CELL = st.sampled_from(["0", "1", "2e-4", "4e-4", "-1", "1e300", "-1e300", "inf", "nan", "", "x", '"', "0.5", "1e-320"])
ROWS = st.lists(st.lists(CELL, min_size=6, max_size=6).map(",".join), max_size=5).map("\n".join)
META = st.lists(
    st.tuples(
        st.sampled_from(["sample_period_s", "rated_power_w", "connection", "note", "é"]),
        st.sampled_from(["0", "-1", "1e-320", "1e308", "nan", "2e-4", "x", ""]),
    ).map(lambda pair: f"# {pair[0]}: {pair[1]}\n"),
    max_size=3,
).map("".join)
ENDINGS = st.sampled_from([".csv", ".csv.gz", ".parquet"])


def read(path):
    return to_standstill(read_table(path))


@FEW
@given(st.binary(max_size=300), ENDINGS)
def test_random_bytes_as_a_recording_give_a_typed_error(tmp_path, data, ending):
    path = tmp_path / f"r{ending}"
    path.write_bytes(data)
    typed(lambda: read(path))


@FEW
@given(META, ROWS)
def test_a_table_of_nonsense_gives_a_typed_error_or_a_recording(tmp_path, metadata, rows):
    path = tmp_path / "r.csv"
    path.write_bytes(metadata.encode() + HEADER + rows.encode())
    typed(lambda: read(path))


@pytest.fixture(scope="module")
def packed():
    """A good recording as gzip and as Parquet."""
    time = np.arange(60) * PERIOD_S
    columns = {name: np.zeros(60) for name in ("segment", "axis_deg", "voltage_axis_v", "current_u_a", "current_v_a")}
    parquet = io.BytesIO()
    pa_parquet.write_table(pa.table({"time_s": time} | columns), parquet, compression="zstd")
    rows = "\n".join(f"{t:.6f},0,0,1,2,3" for t in time)
    return {".csv.gz": gzip.compress(HEADER + rows.encode()), ".parquet": parquet.getvalue()}


DAMAGE = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def damaged(data: bytes, place: int, flip: int, is_cut: bool) -> bytes:
    place %= len(data)
    return data[:place] if is_cut else data[:place] + bytes([data[place] ^ flip]) + data[place + 1 :]


@DAMAGE
@given(st.integers(0, 10**6), st.integers(1, 255), st.booleans())
def test_a_damaged_parquet_gives_a_typed_error_or_a_recording(tmp_path, packed, place, flip, is_cut):
    path = tmp_path / "r.parquet"
    path.write_bytes(damaged(packed[".parquet"], place, flip, is_cut))
    typed(lambda: read(path))


def test_a_damaged_gzip_gives_a_typed_error(tmp_path, packed):
    path = tmp_path / "r.csv.gz"
    for place in range(10, len(packed[".csv.gz"])):
        path.write_bytes(damaged(packed[".csv.gz"], place, 1, is_cut=False))
        typed(lambda: read(path))
