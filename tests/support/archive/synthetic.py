"""Archives of many runs, each folder with a chained journal and a summary as a run leaves it; without samples."""

from __future__ import annotations

import datetime as dt
import json
import random
from pathlib import Path
from typing import Any

from commissioner.encoding import plain
from commissioner.run.archive.journal import Journal, digest, read_journal
from commissioner.run.archive.seal import CLOSED, cover
from commissioner.run.archive.summary import NOT_KEPT, summary_of
from commissioner.run.index.rows import utc_of

PLATE = {
    "rated_power_w": 2200.0, "rated_voltage_v": 400.0, "rated_frequency_hz": 50.0, "rated_current_a": 5.0, "rated_speed_rpm": 1420.0,
    "power_factor": 0.82, "pole_pairs": 2, "connection": "star", "inertia_kg_m2": 0.0075,
}  # fmt: skip
MACHINE = {
    "stator_resistance_ohm": 3.716, "rotor_resistance_ohm": 2.185, "leakage_inductance_h": 0.02149, "magnetizing_inductance_h": 0.3091,
}  # fmt: skip
STD = (0.0013, 0.0007, 0.0006, 0.0008)
PEOPLE = ("anna", "bert", "Jörg", "chen")
OUTCOMES = ("commissioned", "commissioned", "commissioned", "rejected", "aborted", "faulted")
FIRST = dt.datetime(2024, 1, 1, 6, tzinfo=dt.UTC)


def quantities(machine: dict[str, float], std: tuple[float, ...] = STD) -> dict[str, Any]:
    """As a result has them; `std` relative."""
    return {
        name: {"value": value, "std": part * value} for (name, value), part in zip(machine.items(), std, strict=True)
    }


def result_of(
    name: str, machine: dict[str, float], *, outcome: str = "commissioned", flux_wb: float = 0.716, degc: float | None = 25.0,
    curve: tuple[tuple[float, float], ...] = (),
) -> dict[str, Any]:  # fmt: skip
    """The result document of a run, as far as lists, trends and comparisons read it."""
    found = quantities(machine)
    found["magnetizing_inductance_h"]["at_stator_flux_wb"] = flux_wb
    return {
        "run": name, "outcome": outcome, "reason": "every parameter is within its acceptance", "error": None, "energised_s": 46.9,
        "parameters": found, "holds_for_stator_flux_wb": flux_wb, "winding_temperature_degc": degc, "written": [],
        "magnetizing_curve": [
            {"stator_flux_wb": flux, "magnetizing_inductance_h": {"value": henry, "std": 0.001 * henry}} for flux, henry in curve
        ],
    }  # fmt: skip


def make_run(
    root: Path, name: str, *, result: dict[str, Any] | None = None, outcome: str = "commissioned", person: str = "anna",
    drive: int = 20250117, origin: dict[str, str] | None = None, profile: str = "simulated", plate: dict[str, Any] | None = None,
    reason: str = "", closed: bool = True,
) -> Path:  # fmt: skip
    """One run folder; `closed` False: as a kill leaves it, before its end was journalled."""
    folder = root / name
    folder.mkdir(parents=True)
    request = {"url": "tcp://192.168.0.20:502", "profile": profile, "nameplate": plate or PLATE, "origin": origin or {}}
    (folder / "request.json").write_text(json.dumps(request), "utf-8")
    journal = _JournalOf(folder / "journal.jsonl", utc_of(name))
    blocks = (0, digest(b""))
    started = {"run": name, "version": "1.0", "host": "laptop-3", "person": person}
    journal.write("run_started", started, blocks, durable=False)
    identity = {"drive_type": "SIM-INV-7A", "serial_number": drive}
    journal.write("drive_identified", identity, blocks, durable=False)
    if closed:
        said = reason or f"every parameter is within its acceptance, or so says {outcome}"
        ended = {"outcome": outcome, "reason": said, "energised_s": 46.9}
        journal.write("run_ended", ended, blocks, durable=False)
        if result is not None:
            (folder / "result.json").write_text(json.dumps(result), "utf-8")
        files = {path.name: cover(path) for path in folder.iterdir() if path.suffix == ".json"}
        (folder / "blocks.bin").write_bytes(b"")
        summary = plain(summary_of(folder, read_journal(folder / "journal.jsonl")), without=NOT_KEPT)
        record = {"files": files, "blocks": {"bytes": 0, "sha256": digest(b"")}, "summary": summary, "seal": None}
        journal.write(CLOSED, record, blocks, durable=False)
        facts = {"bytes": (folder / "journal.jsonl").stat().st_size, "records": journal.records, "head": journal.head}
        (folder / "summary.json").write_text(json.dumps({"summary": summary, "journal": facts}), "utf-8")
    journal.close()
    return folder


class _JournalOf(Journal):
    """A journal whose records were written at a time of the past."""

    def __init__(self, path: Path, utc: str) -> None:
        super().__init__(path)
        self._utc = utc

    def write(self, kind: str, record: object, blocks: tuple[int, str], *, durable: bool) -> None:
        line = {
            "n": self.records,
            "utc": self._utc,
            "previous": self.head,
            "blocks": blocks,
            "kind": kind,
            "record": plain(record),
        }
        text = json.dumps(line, allow_nan=False)
        self._file.write(text + "\n")
        self._file.flush()
        self.records, self.head = self.records + 1, digest(text.encode())


def make_archive(root: Path, count: int, seed: int = 1) -> None:
    """`count` runs of 200 motors on 20 drives, over two years."""
    chance = random.Random(seed)
    for number in range(count):
        when = FIRST + dt.timedelta(minutes=97 * number)
        name = f"{when.strftime('%Y%m%d-%H%M%S')}-simulated-{chance.randrange(16**3):03x}abc"
        outcome, motor = chance.choice(OUTCOMES), chance.randrange(200)
        machine = {key: value * (1 + 0.02 * chance.gauss(0, 1)) for key, value in MACHINE.items()}
        result = result_of(name, machine, outcome=outcome) if outcome in ("commissioned", "rejected") else None
        make_run(
            root, name, result=result, outcome=outcome, person=chance.choice(PEOPLE), drive=20250100 + chance.randrange(20),
            origin={"motor_tag": f"PUMP-{motor:03d}", "motor_serial": f"SN{motor:05d}"},
        )  # fmt: skip
