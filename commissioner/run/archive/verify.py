"""Is a run folder as its run left it? Lines, chain, blocks and files, each loss by name, and what is still usable.

A run that was killed is cut off, not damaged: all that it had written is whole. Folders of version 0.1.0 have no chain; what
can be seen without one is looked at, and they are called unverified.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from commissioner.errors import DataRefused
from commissioner.run.archive.documents import Loss
from commissioner.run.archive.journal import FIRST, Line, Record, read_lines
from commissioner.run.archive.seal import CLOSED, as_closed, cover, covered_files, is_sealed_by, to_come
from commissioner.run.archive.summary import NAME as SUMMARY
from commissioner.run.archive.summary import read_file

if TYPE_CHECKING:
    from commissioner.run.archive.blocks import BlockDamage

INTACT, UNVERIFIED, CUT_OFF, DAMAGED = "intact", "unverified", "cut off", "damaged"
DECIDES = ("journal.jsonl", "snapshot.json", "request.json", "result.json", SUMMARY)
"""What a restore rests on; of a damaged sample or page it only speaks."""
PAGE = "report.html"
NO_SEAL = "no seal: whoever could write the folder could have made it all"


@dataclass(frozen=True)
class Verified:
    """`state`: intact | unverified | cut off | damaged. `usable` says what of the run can still be relied upon. `is_whole`: nothing is
    lost or changed, as far as can be seen."""

    run: str
    state: str
    losses: tuple[Loss, ...]
    usable: str
    records: int
    blocks: int
    samples: int
    lost_samples: int
    seal: str
    remarks: tuple[str, ...]
    is_whole: bool

    def lost_in(self, *files: str) -> tuple[Loss, ...]:
        return tuple(loss for loss in self.losses if loss.file in files)


def verify(folder: Path, key: bytes | None = None) -> Verified:
    """What became of the run in `folder`. With a `key`, a run that its seal does not prove counts as changed."""
    lines, is_torn = read_lines(folder / "journal.jsonl")
    whole = _whole_records(lines)
    is_chained, is_over = _is_chained(whole), _is_over(whole)
    damage: list[BlockDamage] = []
    counts = _count(folder / "blocks.bin", damage)
    closed = _closings(whole)
    losses = [
        *_journal_losses(lines),
        *_end_losses(folder, whole, is_over=is_over),
        *_block_losses(folder, whole, damage, is_over=is_over),
        *_file_losses(folder, whole),
    ]
    said, broken_seal = _seal(folder, whole, key)
    losses += broken_seal
    state = DAMAGED if losses else UNVERIFIED if not is_chained else INTACT if is_over and closed else CUT_OFF
    lost_samples = sum(d.lost_samples or 0 for d in damage)
    return Verified(
        folder.name, state, tuple(losses), _usable(state, whole, losses, *counts, is_over=is_over),
        len(whole), *counts, lost_samples, said, tuple(_remarks(folder, whole, is_torn=is_torn, is_chained=is_chained)),
        not losses,
    )  # fmt: skip


def losses_at_sight(folder: Path) -> tuple[Loss, ...]:
    """What is lost or changed of the journal and of the files it covers, without looking into the samples: for whoever shows a run."""
    lines, _ = read_lines(folder / "journal.jsonl")
    whole = _whole_records(lines)
    return (
        *_journal_losses(lines),
        *_end_losses(folder, whole, is_over=_is_over(whole)),
        *_file_losses(folder, whole),
    )


def _is_chained(whole: list[Record]) -> bool:
    return any("previous" in record for record in whole)


def _is_over(whole: list[Record]) -> bool:
    return any(record["kind"] == "run_ended" for record in whole)


def _closings(whole: list[Record]) -> list[Record]:
    return [record for record in whole if record["kind"] == CLOSED and isinstance(record["record"], dict)]


def refuse_damage(folder: Path, verified: Verified, step: str, *files: str) -> None:
    """DataRefused where one of `files` (all, if none is named) is not as the run left it."""
    losses = verified.lost_in(*files) if files else verified.losses
    if losses:
        raise _damaged(folder, losses[0], step, f"still usable: {verified.usable}; ")


def refuse_changed(folder: Path, step: str, *files: str) -> None:
    """As `refuse_damage`, without looking into the samples: for whoever reads `files` alone."""
    if losses := changed(folder, *files):
        raise _damaged(folder, losses[0], step, "")


def changed(folder: Path, *files: str) -> tuple[Loss, ...]:
    """What of these files is not as the run left it, at sight."""
    return tuple(loss for loss in losses_at_sight(folder) if loss.file in files)


def _damaged(folder: Path, loss: Loss, step: str, usable: str) -> DataRefused:
    return DataRefused(
        f"{folder.name}: {loss.file} is not as the run left it", step=step, value=loss.what, limit="the file as the run left it",
        remedy=f"{usable}`commissioner runs verify` shows all that is lost or changed",
    )  # fmt: skip


# --- journal ---------------------------------------------------------------------------------------------------------
def _whole_records(lines: list[Line]) -> list[Record]:
    """Records up to the first line that is none."""
    records: list[Record] = []
    for line in lines:
        if line.record is None:
            break
        records.append(line.record)
    return records


def _journal_losses(lines: list[Line]) -> Iterator[Loss]:
    """The first place where the journal is not a row of records that follow each other."""
    if not lines:
        yield Loss("journal.jsonl", None, "no record in it")
    before, has_begun = FIRST, False
    for number, line in enumerate(lines):
        if line.record is None:
            yield Loss("journal.jsonl", number, f"line {number + 1} of {len(lines)} is no record")
            return
        if line.record.get("n") != number:
            yield Loss("journal.jsonl", number, _out_of_order(number, line.record.get("n")))
            return
        has_begun |= "previous" in line.record
        if has_begun and line.record.get("previous") != before:
            yield Loss("journal.jsonl", number, _unlike(number, line.record))
            return
        if not has_begun and line.record["kind"] == "run_started":  # versions without a chain did not write it
            yield Loss("journal.jsonl", number, f"record {number} has lost its digest")
            return
        before = line.digest


def _out_of_order(number: int, seen: object) -> str:
    gone = f"{seen - number} records are gone before it" if isinstance(seen, int) and seen > number else "out of order"
    return f"record {seen!r:.20} where {number} belongs: {gone}"


def _unlike(number: int, record: Record) -> str:
    if number == 0:
        return "record 0 is not the first one that was written"
    return f"record {number - 1} was changed, or is not the one that record {number} ({record['kind']:.40}) followed"


def _end_losses(folder: Path, whole: list[Record], *, is_over: bool) -> Iterator[Loss]:
    """A journal that is shorter than what was made from it."""
    summary = read_file(folder / SUMMARY)
    journal = summary.get("journal")
    wanted = journal.get("records") if isinstance(journal, dict) else None
    if isinstance(wanted, int) and wanted > len(whole):
        yield Loss("journal.jsonl", len(whole), f"{len(whole)} records of {wanted}")
    elif (folder / SUMMARY).exists() and not _fits(summary, whole):
        yield Loss(SUMMARY, None, "it is not what the journal's closing record says")
    elif not is_over and (made := _made_after_the_end(folder, whole)):
        yield Loss("journal.jsonl", len(whole), f"its end is gone: {made} was made after the run had ended")


def _made_after_the_end(folder: Path, whole: list[Record]) -> str:
    """The first file that is made once a run has ended; a summary is also made where the folder of a killed run was used."""
    was_used = any(record["kind"] == CLOSED for record in whole)
    names = ("result.json", "recording.parquet", *(() if was_used else (SUMMARY,)))
    return next((name for name in names if (folder / name).exists()), "")


def _fits(summary: Record, whole: list[Record]) -> bool:
    """True where the summary is the one of the closing record it was made from."""
    kept, journal = summary.get("summary"), summary.get("journal")
    number = journal.get("records") if isinstance(journal, dict) else None
    if not isinstance(number, int) or not 0 < number <= len(whole):
        return False
    record = whole[number - 1]
    return record["kind"] == CLOSED and isinstance(record["record"], dict) and record["record"].get("summary") == kept


# --- samples ---------------------------------------------------------------------------------------------------------
def _count(path: Path, damage: list[BlockDamage]) -> tuple[int, int]:
    """Whole blocks and their samples."""
    from commissioner.run.archive.blocks import read_blocks  # late: who shows a run reads no samples

    blocks = samples = 0
    for _, block in read_blocks(path, damage):
        blocks, samples = blocks + 1, samples + block.count
    return blocks, samples


def _block_losses(folder: Path, whole: list[Record], damage: list[BlockDamage], *, is_over: bool) -> Iterator[Loss]:
    path = folder / "blocks.bin"
    data = path.read_bytes() if path.is_file() else b""
    changed = _first_unlike(data, whole)
    wanted = max((bytes_ for _, bytes_, _ in _covered(whole)), default=0)
    for piece in damage:
        if piece.is_tail and not is_over:
            continue  # what a kill tore
        yield Loss("blocks.bin", None, f"no whole block in {piece.where}")
    if len(data) < wanted:
        yield Loss("blocks.bin", None, f"{len(data)} of {wanted} bytes")
    elif changed is not None and not damage:
        yield Loss("blocks.bin", changed, f"samples written before record {changed} were changed")
    elif _closings(whole) and len(data) > wanted and not damage:
        yield Loss(
            "blocks.bin", None, f"{len(data) - wanted} bytes of samples behind the {wanted} that the run had written"
        )


def _covered(whole: list[Record]) -> Iterator[tuple[int, int, str]]:
    """(record, bytes, digest) of the samples that each record covers."""
    for number, record in enumerate(whole):
        match record.get("blocks"):
            case [int(size), str(sha)] if size >= 0:
                yield number, size, sha


def _first_unlike(data: bytes, whole: list[Record]) -> int | None:
    """The first record whose digest over the samples written by then is not theirs; None where all are."""
    found, at = hashlib.sha256(), 0
    for number, size, sha in _covered(whole):
        if size > len(data) or size < at:
            return number
        found.update(data[at:size])
        at = size
        if found.hexdigest() != sha:
            return number
    return None


# --- files -----------------------------------------------------------------------------------------------------------
def _file_losses(folder: Path, whole: list[Record]) -> Iterator[Loss]:
    announced = to_come(whole)
    for name, wanted in as_closed(whole).items():
        path = folder / Path(str(name)).name
        if not path.is_file():
            yield Loss(str(name), None, "the file is gone")
        elif (seen := cover(path)) not in (wanted, *announced.get(name, ())):
            size = wanted.get("bytes") if isinstance(wanted, dict) else None
            yield Loss(
                str(name), None,
                f"{seen['bytes']} bytes instead of {size}" if seen["bytes"] != size else "its content was changed",
            )  # fmt: skip


def _seal(folder: Path, whole: list[Record], key: bytes | None) -> tuple[str, list[Loss]]:
    """What is to be said of the seal; with a key, a run without a valid one is a loss."""
    closed = _closings(whole)
    sealed = [record for record in closed if record["record"].get("seal")]
    if key is None:
        return ("sealed with a key, not checked" if sealed else "none"), []
    if not sealed:
        return "none", [
            Loss("journal.jsonl", None, NO_SEAL if closed else f"{NO_SEAL}; a run that was cut off never got one")
        ]
    last = sealed[-1]
    if not is_sealed_by(key, last.get("previous"), last["record"]):
        return "wrong", [Loss("journal.jsonl", last["n"], "the seal is not of this key, or what it covers was changed")]
    if last is whole[-1]:
        return "valid", []
    said = f"valid up to record {last['n']}; what was added after it has none"
    return said, list(_changed_since(folder, last))


def _changed_since(folder: Path, sealed: Record) -> Iterator[Loss]:
    """Files that are no longer what the seal covers, by records without one: anybody can have written those. The page is left out: it
    follows from the others, and whoever restores without the key writes on top of it that he did."""
    for name, wanted in covered_files([sealed]).items():
        path = folder / Path(str(name)).name
        if name != PAGE and path.is_file() and cover(path) != wanted:
            yield Loss(str(name), None, f"it was changed after record {sealed['n']}, the last that the key sealed")


# --- words -----------------------------------------------------------------------------------------------------------
def _usable(state: str, whole: list[Record], losses: list[Loss], blocks: int, samples: int, *, is_over: bool) -> str:
    sound = min(
        (loss.record for loss in losses if loss.file == "journal.jsonl" and loss.record is not None), default=len(whole)
    )
    records = f"records 0 ... {sound - 1}" if sound else "no record"
    if state == CUT_OFF:
        end = "before the folder was closed" if is_over else "before the run had ended"
        return f"cut off {end}, whole up to record {len(whole) - 1} ({_what(whole)}) and {samples} samples"
    return f"{records} of the journal, {samples} samples in {blocks} whole blocks"


def _what(whole: list[Record]) -> str:
    return f"{whole[-1]['kind']:.40} at {whole[-1].get('utc')!s:.32}" if whole else "none"


def _remarks(folder: Path, whole: list[Record], *, is_torn: bool, is_chained: bool) -> Iterator[str]:
    if not is_chained:
        yield "made by a version without a chain of digests: what was changed with care cannot be seen"
    else:
        yield "a chain without a seal does not stop somebody who computes it anew; --seal KEYFILE does"
    for name in to_come(whole):
        yield f"{name}: it or what was to take its place; the process that wrote it was killed before it closed the folder"
    if is_torn:
        yield "the last line of the journal is torn, as a kill or a power loss leaves it: no whole record is lost; a copy leaves it out"
    started: Any = whole[0]["record"] if whole and whole[0]["kind"] == "run_started" else None
    if isinstance(started, dict) and started.get("run") != folder.name:
        yield f"the folder has another name than its run, {started.get('run')!s:.80}"
