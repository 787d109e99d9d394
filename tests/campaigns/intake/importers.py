"""Damaged recordings of every format: `python -m tests.campaigns.intake.importers --mutants 20000 --seed 1 [--format NAME]`.

Each mutant of a sound file - bits turned, bytes overwritten, cut off, taken out, doubled, numbers replaced by nonsense - is read as
`identify` and `diagnose` read it. It is a table or one typed refusal: no other exception, no more than `MOST_S` CPU seconds, and no more
than `MOST_BYTES` of address space beyond what the reader began with.
"""

from __future__ import annotations

import argparse
import random
import re
import resource
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from commissioner.errors import CommissionerError
from commissioner.recordings.importers import contract_table

DATA = Path(__file__).parents[2] / "data" / "foreign_formats"
MOST_S, MOST_BYTES = 5.0, 1 << 30
ROWS, PERIOD_S = 60, 1.25e-4
NONSENSE = (
    b"",
    b"nan",
    b"inf",
    b"-1",
    b"0",
    b"1e999",
    b"99999999999999999999",
    b"x",
    b"1,5",
    b"-0",
    b"\xff",
    b"1e-400",
)
NUMBER = re.compile(rb"[0-9][0-9.eE+-]*")


@dataclass(frozen=True)
class Outcome:
    """`broken`: what escaped or was exceeded; empty where the mutant was read or refused."""

    format: str
    number: int
    broken: str
    was_read: bool
    seconds: float


def sound_files(folder: Path) -> Mapping[str, list[tuple[Path, ...]]]:
    """Per format, sound files; of a COMTRADE both, the one that is read first."""
    import pyarrow as pa
    import pyarrow.parquet as pq
    from scipy.io import savemat

    time_s = np.arange(ROWS) * PERIOD_S
    waves = [np.cos(2 * np.pi * 50 * time_s - k * 2 * np.pi / 3) for k in range(3)]
    columns = {"time_s": time_s}
    columns |= {f"current_{'uvw'[k]}_a": 5.0 * waves[k] for k in range(3)}
    columns |= {f"voltage_{'uvw'[k]}_v": 325.0 * waves[k] for k in range(3)}
    pq.write_table(pa.table(columns), folder / "plain.parquet", compression="snappy")
    pq.write_table(
        pa.table(columns).replace_schema_metadata({"rated_power_w": "2200"}),
        folder / "zipped.parquet",
        compression="zstd",
    )
    savemat(folder / "plain.mat", dict(columns))
    savemat(folder / "zipped.mat", {"recording": dict(columns)}, do_compression=True)
    rows = np.column_stack(list(columns.values()))
    np.savetxt(folder / "ours.csv", rows, "%.6g", ",", header=",".join(columns), comments="")
    foreign = "Scope 7;;\nDate;2026-02-01;\n\nt;I1;I2;I3;U1;U2;U3\ns;mA;mA;mA;V;V;V\n"
    foreign += "\n".join(
        ";".join(f"{v:.5g}".replace(".", ",") for v in row * [1, 1e3, 1e3, 1e3, 1, 1, 1]) for row in rows
    )
    (folder / "foreign.csv").write_text(foreign + "\n", encoding="utf-16")
    comtrade = [_comtrade(folder, form, waves) for form in ("ASCII", "BINARY", "FLOAT32")]
    return {
        "comtrade": comtrade,
        "tdms": [(DATA / "logger.tdms",)],
        "mdf4": [(DATA / name,) for name in ("logger.mf4", "zipped.mf4", "turned.mf4")],
        "matlab": [(folder / "plain.mat",), (folder / "zipped.mat",)],
        "parquet": [(folder / "plain.parquet",), (folder / "zipped.parquet",)],
        "csv": [(folder / "ours.csv",), (folder / "foreign.csv",)],
    }  # fmt: skip


def _comtrade(folder: Path, form: str, waves: Sequence[np.ndarray]) -> tuple[Path, ...]:
    """Configuration and samples as IEEE C37.111-1999 has them."""
    channels = [
        f"{k + 1},{'IU'[k // 3]}{k % 3 + 1},{'ABC'[k % 3]},,{'AV'[k // 3]},0.01,0,0,-99999,99999,1,1,P"
        for k in range(6)
    ]
    when = "01/02/2026,10:00:00.000000"
    lines = ["pump house,3,1999", "6,6A,0D", *channels, "50", "1", f"8000,{ROWS}", when, when, form, "1"]
    counts = [[round(size * wave[n] / 0.01) for size in (5, 325) for wave in waves] for n in range(ROWS)]
    if form == "ASCII":
        data = "".join(f"{n + 1},{125 * n},{','.join(map(str, row))}\r\n" for n, row in enumerate(counts)).encode()
    else:
        kind = np.dtype("<i2" if form == "BINARY" else "<f4")
        data = b"".join(
            np.array([n + 1, 125 * n], "<u4").tobytes() + np.array(row).astype(kind).tobytes()
            for n, row in enumerate(counts)
        )
    for name, content in ((f"{form}.cfg", "\r\n".join(lines).encode() + b"\r\n"), (f"{form}.dat", data)):
        (folder / name).write_bytes(content)
    return folder / f"{form}.cfg", folder / f"{form}.dat"


def mutated(data: bytes, rng: random.Random) -> bytes:
    """One to three damages."""
    for _ in range(rng.randint(1, 3)):
        data = rng.choice(DAMAGES)(data, rng) if data else data
    return data


def _place(data: bytes, rng: random.Random) -> int:
    """Anywhere; headers as often as all the rest."""
    return rng.randrange(min(len(data), 512) if rng.random() < 0.5 else len(data))


def _turned(data: bytes, rng: random.Random) -> bytes:
    at = _place(data, rng)
    return data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]


def _overwritten(data: bytes, rng: random.Random) -> bytes:
    at, size = _place(data, rng), rng.choice((1, 2, 4, 8))
    return data[:at] + rng.choice((b"\0", b"\xff", b"\x7f", b"\x80", rng.randbytes(1))) * size + data[at + size :]


def _cut(data: bytes, rng: random.Random) -> bytes:
    return data[: _place(data, rng)]


def _taken_out(data: bytes, rng: random.Random) -> bytes:
    at = _place(data, rng)
    return data[:at] + data[at + rng.randint(1, 64) :]


def _doubled(data: bytes, rng: random.Random) -> bytes:
    at, size = _place(data, rng), rng.randint(1, 64)
    return data[: at + size] + data[at : at + size] + data[at + size :]


def _nonsense(data: bytes, rng: random.Random) -> bytes:
    numbers = list(NUMBER.finditer(data))
    if not numbers:
        return _overwritten(data, rng)
    found = rng.choice(numbers[:60] if rng.random() < 0.5 else numbers)
    return data[: found.start()] + rng.choice(NONSENSE) + data[found.end() :]


DAMAGES: tuple[Callable[[bytes, random.Random], bytes], ...] = (
    _turned,
    _overwritten,
    _cut,
    _taken_out,
    _doubled,
    _nonsense,
)


def campaign(formats: Sequence[str], mutants: int, seed: int) -> Iterator[Outcome]:
    """In this process, one after the other: an address space that grows is seen."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        sound = sound_files(folder)
        for form in formats:
            for files in sound[form]:
                contract_table(files[0])  # what is refused unharmed proves nothing
            for number in range(mutants):
                yield _one(form, sound[form], number, seed, folder)


def _one(form: str, sound: Sequence[tuple[Path, ...]], number: int, seed: int, folder: Path) -> Outcome:
    rng = random.Random(f"{form} {seed} {number}")
    files = rng.choice(sound)
    harmed = rng.randrange(len(files))
    for k, file in enumerate(files):
        data = file.read_bytes()
        (folder / f"mutant{file.suffix}").write_bytes(mutated(data, rng) if k == harmed else data)
    began_s, was_read, broken = time.process_time(), False, ""
    try:
        contract_table(folder / f"mutant{files[0].suffix}")
        was_read = True
    except CommissionerError:
        pass
    except Exception as escaped:
        broken = f"{type(escaped).__name__}: {escaped}"
    seconds = time.process_time() - began_s
    if seconds > MOST_S:
        broken = broken or f"{seconds:.1f} CPU seconds"
    return Outcome(form, number, broken, was_read, seconds)


def report(outcomes: Sequence[Outcome]) -> str:
    rows = []
    for form, count in Counter(o.format for o in outcomes).items():
        of = [o for o in outcomes if o.format == form]
        rows.append(
            f"{form:9s} {count} mutants, {sum(o.was_read for o in of)} read, {sum(bool(o.broken) for o in of)} broken, longest "
            f"{max(o.seconds for o in of):.2f} CPU s"
        )
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return "\n".join([*rows, f"largest resident memory {peak_mb:.0f} MB"])


def bound_memory() -> None:
    """Of this process from here on: what asks for more gets a MemoryError."""
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[0])
    most = pages * resource.getpagesize() + MOST_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (most, resource.getrlimit(resource.RLIMIT_AS)[1]))


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.campaigns.intake.importers", description=__doc__)
    parser.add_argument("--mutants", type=int, default=20000, help="of each format")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--format", action="append", dest="formats", choices=FORMATS)
    options = parser.parse_args(arguments)
    warnings.simplefilter("ignore")
    outcomes: list[Outcome] = []
    for outcome in campaign(options.formats or FORMATS, options.mutants, options.seed):
        if not outcomes:
            bound_memory()
        outcomes.append(outcome)
        if outcome.broken:
            print(f"{outcome.format} {outcome.number}: {outcome.broken[:200]}", flush=True)
        if len(outcomes) % 5000 == 0:
            print(report(outcomes), flush=True)
    print(report(outcomes))
    return int(any(outcome.broken for outcome in outcomes))


FORMATS = ("comtrade", "tdms", "mdf4", "matlab", "parquet", "csv")

if __name__ == "__main__":
    sys.exit(main())
