"""Recordings and TOML from strangers: they run nothing, they exhaust nothing, and what is wrong with them is typed."""

import functools
import gzip
import io
import json
import os
import subprocess
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pa_parquet
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from commissioner.errors import CommissionerError, ConfigurationError, DataRefused, UsageError
from commissioner.link.files.drive_file import load_profile
from commissioner.recordings import baseline, bounds, plate, table
from commissioner.recordings.formats import matlab
from commissioner.recordings.importers import import_table
from commissioner.recordings.table import read_table
from commissioner.settings import load_motor

FEW = settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
SIGNALS = ("segment", "axis_deg", "voltage_axis_v", "current_u_a", "current_v_a")
MEGABYTE = 1 << 20
FOREIGN = Path(__file__).parents[2] / "data" / "foreign_formats"


def typed(act) -> object:
    """What `act` gives, or the CommissionerError it raises; anything else is a failure of the test."""
    try:
        return act()
    except CommissionerError as error:
        return error


def columns(rows):
    return {"time_s": np.arange(rows) * 2e-4} | {name: np.zeros(rows) for name in SIGNALS}


def test_a_gzip_of_more_than_the_limit_is_refused_without_unpacking_it_into_memory(tmp_path, monkeypatch):
    path = tmp_path / "bomb.csv.gz"
    path.write_bytes(gzip.compress(bytes(16 * MEGABYTE)) * 16)
    monkeypatch.setattr(table, "bounded_text", functools.partial(bounds.bounded_text, limit=63 * MEGABYTE))
    tracemalloc.start()
    try:
        with pytest.raises(DataRefused, match="unpacks to too much"):
            read_table(path)
        assert tracemalloc.get_traced_memory()[1] < 32 * MEGABYTE
    finally:
        tracemalloc.stop()


def repeated_text(rows):
    """A text of a megabyte, stored once and said to stand in every row."""
    return pa.DictionaryArray.from_arrays(pa.array(np.zeros(rows, np.int32)), pa.array(["x" * MEGABYTE])).cast(
        pa.dictionary(pa.int32(), pa.string())
    )


@pytest.mark.parametrize(("name", "reads"), [("note", True), ("current_w_a", False)])
def test_a_parquet_text_that_unpacks_to_gigabytes_is_never_read(tmp_path, name, reads):
    rows = 4000
    path = tmp_path / "bomb.parquet"
    pa_parquet.write_table(pa.table(columns(rows) | {name: repeated_text(rows)}), path)
    assert path.stat().st_size < 4 * MEGABYTE
    before = pa.default_memory_pool().max_memory()
    seen = typed(lambda: read_table(path))
    assert pa.default_memory_pool().max_memory() - before < 64 * MEGABYTE
    if reads:
        assert set(seen.columns) == {"time_s", *SIGNALS}
    else:
        assert isinstance(seen, DataRefused)
        assert "not numeric" in seen.what


def test_a_parquet_of_more_numbers_than_the_limit_is_refused_before_they_are_read(tmp_path, monkeypatch):
    path = tmp_path / "bomb.parquet"
    pa_parquet.write_table(pa.table(columns(200_000)), path, compression="zstd")
    monkeypatch.setattr(bounds, "MAX_BYTES", 6 * 8 * 200_000 - 1)
    with pytest.raises(DataRefused, match="unpacks to too much"):
        read_table(path)
    monkeypatch.setattr(bounds, "MAX_BYTES", 6 * 8 * 200_000)
    assert read_table(path).columns["time_s"].size == 200_000


def test_a_parquet_whose_metadata_end_arrow_is_refused_in_words():
    """In a process of its own: what must not happen is its end by signal 6."""
    path = FOREIGN / "torn_histogram.parquet"
    look = "import sys; from commissioner.cli.app import main; sys.argv[1:] = ['recordings', 'import', sys.argv[1]]; main()"
    seen = subprocess.run([sys.executable, "-c", look, str(path)], capture_output=True, text=True, check=False)
    assert seen.returncode == 3, seen.stderr
    assert "not a readable table" in " ".join(seen.stderr.split())


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_a_table_of_countless_columns_is_refused(tmp_path, ending):
    names = [f"c{k}" for k in range(bounds.MAX_COLUMNS + 1)]
    path = tmp_path / f"wide{ending}"
    if ending == ".csv":
        path.write_text(",".join(names) + "\n" + ",".join("0" for _ in names) + "\n")
    else:
        pa_parquet.write_table(pa.table({name: [0.0] for name in names}), path)
    with pytest.raises(DataRefused, match="unpacks to too much"):
        read_table(path)


def test_a_matlab_file_whose_variables_unpack_to_more_than_the_limit_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "bomb.mat"
    savemat(path, {"a": np.zeros(4 * MEGABYTE)}, do_compression=True)
    assert path.stat().st_size < MEGABYTE
    assert matlab.vectors(path)["a"].size == 4 * MEGABYTE
    monkeypatch.setattr(bounds, "MIN_UNPACKED_BYTES", 32 * MEGABYTE)
    with pytest.raises(DataRefused, match="unpacks to too much"):
        matlab.vectors(path)


PEAK = """
import sys
from pathlib import Path
from commissioner.errors import DataRefused
from commissioner.recordings.importers import contract_table, import_table
peak_kb = lambda: next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmHWM"))
before = peak_kb()
for read in (import_table, contract_table):
    try:
        read(Path(sys.argv[1]))
    except DataRefused:
        pass
print(peak_kb() - before)
"""


BOMBS = {
    "numbers.csv.gz": lambda path: path.write_bytes(gzip.compress(b"1\n" * (20 * MEGABYTE))),
    "cells.csv.gz": lambda path: path.write_bytes(gzip.compress(b"0;1;2;3;4;5;6\n" * (4 * MEGABYTE))),
    "line.csv.gz": lambda path: path.write_bytes(gzip.compress(b"a" * (60 * MEGABYTE))),
    "big.mat": lambda path: savemat(path, {"a": np.zeros(30 * MEGABYTE)}, do_compression=True),
    "bytes.mat": lambda path: savemat(path, {"a": np.zeros(60 * MEGABYTE, np.int8)}, do_compression=True),
    "many.mat": lambda path: savemat(path, {f"a{k}": np.zeros(4 * MEGABYTE) for k in range(8)}, do_compression=True),
    "big.parquet": lambda path: pa_parquet.write_table(
        pa.table(dict.fromkeys("abcdef", np.zeros(12 * MEGABYTE))), path
    ),
}


@pytest.mark.parametrize("name", BOMBS)
def test_a_small_file_costs_little_memory_whatever_it_unpacks_to(tmp_path, name):
    BOMBS[name](tmp_path / name)
    assert (tmp_path / name).stat().st_size < 3 * MEGABYTE
    done = subprocess.run(
        [sys.executable, "-c", PEAK, tmp_path / name], capture_output=True, text=True, timeout=120, check=True
    )
    assert int(done.stdout) < 300 * 1024, f"{done.stdout} kB"


def test_a_packed_mdf_is_held_to_what_it_may_unpack_to(monkeypatch):
    """The same packed data, said to belong to ever more groups, would unpack to any size."""
    path = Path(__file__).parents[2] / "data" / "foreign_formats" / "zipped.mf4"
    monkeypatch.setattr(bounds, "MIN_UNPACKED_BYTES", 1000)
    monkeypatch.setattr(bounds, "MAX_RATIO", 1)
    seen = typed(lambda: import_table(path))
    assert isinstance(seen, DataRefused) and "unpacks to too much" in seen.what


def test_a_foreign_text_above_its_limit_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "scope.csv"
    path.write_text("t;ia;ib\n" + "0,1;2,0;3,0\n" * 1000)
    monkeypatch.setattr("commissioner.recordings.formats.foreign_csv.MAX_FOREIGN_BYTES", 1000)
    with pytest.raises(DataRefused):
        import_table(path)


@pytest.mark.parametrize("name", ["pipe.csv", "pipe.mat", "pipe.toml"])
def test_a_pipe_is_not_waited_for(tmp_path, name):
    path = tmp_path / name
    os.mkfifo(path)
    with pytest.raises(UsageError, match="is no regular file"):
        load_motor(str(path)) if name.endswith("toml") else import_table(path)


@FEW
@given(
    st.binary(max_size=400),
    st.sampled_from([".csv", ".csv.gz", ".parquet", ".mat", ".txt", ".tdms", ".mf4", ".cfg", ".cff"]),
)
def test_random_bytes_give_a_typed_error_in_every_importer(tmp_path, data, ending):
    path = tmp_path / f"r{ending}"
    path.write_bytes(data)
    assert isinstance(typed(lambda: import_table(path)), CommissionerError)


@pytest.fixture(scope="module")
def matlab_files():
    """A good recording as a MATLAB v5 file, plain and compressed."""
    content = {"t": np.arange(40) * 1e-4} | {name: np.ones(40) for name in ("ia", "ib", "ic", "va", "vb", "vc")}
    files = []
    for is_compressed in (False, True):
        files.append(io.BytesIO())
        savemat(files[-1], content, do_compression=is_compressed)
    return [file.getvalue() for file in files]


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.booleans(), st.integers(0, 10**6), st.integers(1, 255), st.booleans())
def test_a_damaged_matlab_file_gives_a_typed_error_or_a_recording(
    tmp_path, matlab_files, compressed, place, flip, is_cut
):
    data = matlab_files[compressed]
    place %= len(data)
    path = tmp_path / "r.mat"
    path.write_bytes(data[:place] if is_cut else data[:place] + bytes([data[place] ^ flip]) + data[place + 1 :])
    typed(lambda: import_table(path))


def test_every_turned_bit_of_a_matlab_file_leaves_the_process_alive(tmp_path, matlab_files):
    """scipy.io.loadmat ends by a segmentation fault on some of these."""
    path = tmp_path / "r.mat"
    for place in range(128, 250):
        for bit in range(8):
            data = bytearray(matlab_files[False])
            data[place] ^= 1 << bit
            path.write_bytes(data)
            typed(lambda: import_table(path))


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("kind", [np.float64, np.float32, np.int16, np.uint8])
def test_matlab_arrays_come_as_scipy_wrote_them(tmp_path, compressed, kind):
    rng = np.random.default_rng(5)
    wide, tall = rng.integers(0, 99, (3, 40)).astype(kind), rng.integers(0, 99, (40, 2)).astype(kind)
    path = tmp_path / "r.mat"
    content = {"w": wide, "s": {"tall": tall, "deep": {"x": 2.5}}, "text": "abc", "z": np.ones(3) * 1j, "e": []}
    savemat(path, content, do_compression=compressed)
    found = matlab.vectors(path)
    for k in range(3):
        np.testing.assert_array_equal(found[f"w.{k}"], wide[k])
    for k in range(2):
        np.testing.assert_array_equal(found[f"s.tall.{k}"], tall[:, k])
    assert found["s.deep.x"] == [2.5]
    assert {name for name in found if name[0] in "tz"} == set()


CELLS = st.sampled_from(
    ["t", "ia", "fs", "0", "1,5", "2.5", "-1", "inf", "nan", "", "x", "mA", "(V)", '"', "\x00", "# fs: 0"]
)


@FEW
@given(st.lists(st.lists(CELLS, min_size=1, max_size=8), max_size=8), st.sampled_from([";", ",", "\t", " "]))
def test_a_foreign_table_of_nonsense_gives_a_typed_error_or_a_recording(tmp_path, rows, separator):
    path = tmp_path / "r.csv"
    path.write_text("\n".join(separator.join(row) for row in rows))
    typed(lambda: import_table(path))


HOSTILE_TOML = {
    "nesting without end": "a = " + "[" * 100_000,
    "tables without end": "[" + ".".join("a" * 20_000) + "]",
    "a key without end": ".".join("a" * 50_000) + " = 1",
    "digits without end": "rated_power_w = " + "9" * 10_000,
    "inline tables": "a = " + "{b = " * 20_000,
    "inline keys": "\n".join(f"k{n} = {{{'.'.join('a' * 480)} = 1}}" for n in range(250)),
    "a huge file": "#" * 250_001,
    "no text": "\udcff",
    "code": "rated_power_w = \"__import__('os').system('true')\"",
}


@pytest.mark.parametrize("what", HOSTILE_TOML)
@pytest.mark.parametrize("read", [load_motor, load_profile])
def test_hostile_toml_is_a_configuration_error(tmp_path, what, read):
    path = tmp_path / "stranger.toml"
    path.write_bytes(HOSTILE_TOML[what].encode("utf-8", "surrogateescape"))
    with pytest.raises(ConfigurationError):
        read(str(path))


@FEW
@given(st.binary(max_size=300))
def test_random_bytes_as_toml_are_a_configuration_error(tmp_path, data):
    path = tmp_path / "stranger.toml"
    path.write_bytes(data)
    for read in (load_motor, load_profile):
        assert isinstance(typed(lambda act=read: act(str(path))), ConfigurationError)


@pytest.mark.parametrize(
    "text", ["[" * 200_000, "1" * 10_000, "{}", json.dumps({"parameters": [], "version": 1}), "\x00"]
)
@pytest.mark.parametrize("read", [plate.start_from, baseline.read])
def test_hostile_json_is_a_configuration_error(tmp_path, text, read):
    path = tmp_path / "stranger.json"
    path.write_text(text)
    with pytest.raises(ConfigurationError):
        read(path)
