"""The forty files rewritten as editors, spreadsheets and cables do: the values stay right, or the file is refused, or it is said.

python -m tests.campaigns.intake.rewritten
"""

from __future__ import annotations

import argparse
import gzip
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from commissioner.errors import CommissionerError
from commissioner.recordings.importers import read_running
from commissioner.recordings.reading.mapping import ChannelMap, Target
from tests.campaigns.intake.forty import AMPS, FILES, ROWS, TARGETS, U, V

MIDDLE = 300


def _lines(data: bytes) -> tuple[list[str], str]:
    encoding = next(e for e in ("utf-16", "utf-8", "gbk", "cp1252") if _decodes(data, e))
    return data.decode(encoding).splitlines(), encoding


def _decodes(data: bytes, encoding: str) -> bool:
    if encoding == "utf-16" and data[:2] not in (b"\xff\xfe", b"\xfe\xff"):
        return False
    try:
        data.decode(encoding)
    except UnicodeDecodeError:
        return False
    return True


def _by_lines(change: Callable[[list[str], int], list[str]]) -> Callable[[bytes], bytes]:
    """A rewriting of lines; the second argument is where the rows of numbers begin."""

    def rewritten(data: bytes) -> bytes:
        lines, encoding = _lines(data)
        numbers = (
            sum(bool(line.strip()) for line in lines[-ROWS - 3 :])
            and len(lines) - ROWS - (lines[-1] == "End of data") * 2
        )
        return ("\n".join(change(lines, numbers)) + "\n").encode(encoding)

    return rewritten


REWRITINGS: dict[str, Callable[[bytes], bytes]] = {
    "windows lines": _by_lines(lambda lines, _: [line + "\r" for line in lines]),
    "empty rows": _by_lines(lambda lines, n: [*lines[:n], "", *lines[n:], "", ""]),
    "row doubled": _by_lines(lambda lines, n: [*lines[: n + MIDDLE], lines[n + MIDDLE], *lines[n + MIDDLE :]]),
    "rows lost": _by_lines(lambda lines, n: [*lines[: n + MIDDLE], *lines[n + MIDDLE + 40 :]]),
    "rows exchanged": _by_lines(
        lambda lines, n: [*lines[: n + 50], lines[n + 51], lines[n + 50], *lines[n + 52 :]]
    ),
    "cell lost": _by_lines(lambda lines, n: [*lines[: n + 50], lines[n + 50][: len(lines[n + 50]) // 2], *lines[n + 51 :]]),
    "garbage": _by_lines(lambda lines, n: [*lines[: n + 50], "#### error ####", *lines[n + 50 :]]),
    "packed": lambda data: gzip.compress(data, mtime=0),
}  # fmt: skip


def verdict(name: str, how: str, folder: Path) -> str:
    """`right`, `said`, `refused`; or what is wrong without a word."""
    made = FILES[name]()
    path = folder / f"file{made.ending}{'.gz' if how == 'packed' else ''}"
    path.write_bytes(REWRITINGS[how](made.data))
    told = ChannelMap({c: Target(t) for c, t in zip(made.channels, TARGETS, strict=True)} if made.channels else {})
    try:
        seen = read_running(path, told)
    except CommissionerError:
        return "refused"
    start = seen.time_s[0]
    at = np.round((seen.time_s - start) * 5000.0).astype(int)
    volts = V if made.volts == "line" else U
    for truth, got in ((AMPS, seen.currents_a), (volts, seen.voltages_v)):
        for k in range(3):
            good = np.isfinite(got[k]) & (at >= 0) & (at < ROWS)
            if np.any(np.abs(got[k][good] - truth[k][at[good]]) > 0.02 * np.max(np.abs(truth[k]))):
                return "said" if seen.notes else "WRONG"
    return "right"


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    counts: dict[str, int] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in FILES:
            for how in REWRITINGS:
                said = verdict(name, how, Path(folder))
                counts[said] = counts.get(said, 0) + 1
                if said == "WRONG":
                    print(f"{name}, {how}")
    print(", ".join(f"{count} {said}" for said, count in sorted(counts.items())))


if __name__ == "__main__":
    main()
