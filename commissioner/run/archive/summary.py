"""One run in a row of a list, from its journal; kept as `summary.json`, so that a list never reads a journal."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

from commissioner.encoding import JsonObject
from commissioner.errors import DataRefused
from commissioner.report.run.standing import Held, Standing
from commissioner.run.archive.documents import read_document, read_result
from commissioner.run.archive.journal import Record, is_being_written, read_journal
from commissioner.run.archive.seal import as_closed

NAME = "summary.json"
NOT_KEPT = frozenset({"folder", "result"})
"""Fields of a summary that `summary.json` is without: where the folder lies, the whole result."""
RESULT, NOT_IDENTIFIED = "result.json", "not identified"
GIVEN_BACK = f"{Held.AS_BEFORE}, read back"
NO_RESULT, CAN_BE_MADE = (
    "the process ended before its result was kept",
    ": `commissioner runs report` makes it from the samples",
)
"""Said of such a run; the latter where it applied a test of ours."""
CALLED_OFF = "restore_called_off"
"""Kind of the record of a restore that failed and left the drive as it was, seen in it: `held` is what was known of it before."""
NAMED = "motor_named"
"""Kind of the record that says which motor a run was made on, where a person says so afterwards."""


def motor_names(summary: Mapping[str, Any]) -> tuple[str, ...]:
    """What names a run's motor, each alone: its tag, its serial number, the name its plate was given under."""
    return tuple(name for key in ("motor_tag", "motor_serial", "motor_name") if (name := summary.get(key)))


@dataclass(frozen=True)
class RunSummary:
    """`held`: which parameter set the drive holds after the run, as far as the run could know; `written` says it in a sentence, `held_utc`
    since when, empty where it holds what it held before. `lacks_result`: it judged, and its process ended before that was kept. `motor`:
    the plate; `parameters`: value and standard error of each; both empty where the run did not get so far. `motor_tag`, `motor_serial`:
    which motor it is, as a person said; `motor_name`: under which name the plate was given. `energised_s`: None of a run that was cut
    off."""

    run: str
    folder: str
    outcome: str
    reason: str
    drive: str
    energised_s: float | None
    written: str
    result: JsonObject | None = None
    serial_number: int | None = None
    started_utc: str = ""
    ended_utc: str = ""
    person: str = ""
    host: str = ""
    version: str = ""
    url: str = ""
    profile: str = ""
    motor: Mapping[str, Any] = field(default_factory=dict)
    parameters: Mapping[str, Any] = field(default_factory=dict)
    motor_tag: str = ""
    motor_serial: str = ""
    motor_name: str = ""
    held_utc: str = ""
    lacks_result: bool = False
    held: Held = Held.AS_BEFORE

    @property
    def motor_id(self) -> str:
        """The motor's tag, or its serial number; empty where nobody said which motor it is."""
        return self.motor_tag or self.motor_serial

    @property
    def motor_names(self) -> tuple[str, ...]:
        """Each names the run's motor."""
        return motor_names(vars(self))

    @property
    def standing(self) -> Standing:
        """The outcome, and whether the drive holds what came of it."""
        return Standing.of(self.outcome, self.held, lacks_result=self.lacks_result)

    @property
    def holds(self) -> str:
        """What the drive holds, where the outcome alone would let one think otherwise: new values behind a run that was cut off after it
        had written them; else empty."""
        is_told = self.is_unknown or (self.held is Held.NEW and self.outcome != Standing.COMMISSIONED)
        return self.held.value if is_told else ""

    @property
    def is_unknown(self) -> bool:
        """Only the drive can tell which parameter set it holds."""
        return self.held is Held.OLD_OR_NEW


def summarise(folder: Path) -> RunSummary:
    """The run in `folder`, from its result if it has one, else from its journal."""
    return summary_of(folder, read_journal(folder / "journal.jsonl"), goes_on=is_being_written)


def summary_of(folder: Path, records: list[Record], goes_on: Callable[[Path], bool] = lambda _: False) -> RunSummary:
    """As `summarise`, the journal's records read already; `goes_on`: whether a process may still keep the result, not asked by itself."""
    lacks = lacks_result(folder, records) and not goes_on(folder)
    end: Record = next(reversed(_of(records, "run_ended")), {})
    start: Record = next(iter(_of(records, "run_started")), {})
    identity: Record = next(iter(_of(records, "drive_identified")), {})
    result, request = sound_result(folder) or {}, read_file(folder / "request.json")
    serial = identity.get("serial_number")
    origin = _mapping(request.get("origin"))
    named: Mapping[str, Any] = next(reversed(_of(records, NAMED)), origin)
    told = _told(records)
    return RunSummary(
        run=folder.name,
        folder=str(folder),
        outcome=_text(end, "outcome") or Standing.CUT_OFF.value,
        reason=_reason(records, end, lacks=lacks),
        drive=_drive(identity),
        energised_s=_seconds(end.get("energised_s")),
        written=told.sentence,
        result=result or None,
        serial_number=serial if isinstance(serial, int) and not isinstance(serial, bool) else None,
        started_utc=_text(records[0], "utc") if records else "",
        ended_utc=next((_text(line, "utc") for line in records if line["kind"] == "run_ended"), ""),
        person=_text(start, "person"),
        host=_text(start, "host"),
        version=_text(start, "version"),
        url=_text(request, "url"),
        profile=_text(request, "profile"),
        motor=_mapping(request.get("nameplate")),
        parameters=_mapping(result.get("parameters")),
        motor_tag=_text(named, "motor_tag"),
        motor_serial=_text(named, "motor_serial"),
        motor_name=_text(origin, "motor"),
        held_utc=told.utc,
        lacks_result=lacks,
        held=told.held,
    )


def read_summary(folder: Path, journal_bytes: int) -> RunSummary | None:
    """What the folder's `summary.json` says; None where there is none, or not of the journal as it is now."""
    document = read_file(folder / NAME)
    kept, journal = document.get("summary"), document.get("journal")
    if not isinstance(kept, dict) or not isinstance(journal, dict) or journal.get("bytes") != journal_bytes:
        return None
    try:
        summary = RunSummary(folder=str(folder), **kept | {"held": held_of(kept)})
    except (TypeError, ValueError, LookupError, AttributeError):
        return None
    return replace(summary, run=folder.name) if _is_typed(summary) else None


def held_of(summary: Mapping[str, Any]) -> Held:
    """Of a summary as it was kept: those of earlier versions say it by the beginning of their sentence alone."""
    return Held(summary["held"]) if "held" in summary else Held.of(summary["written"])


def unreadable(folder: Path, error: Exception) -> RunSummary:
    """The row of a folder that cannot be read at all."""
    what = getattr(error, "what", "") or f"{type(error).__name__}: {error}"
    if isinstance(error, FileNotFoundError):
        what = f"its {Path(error.filename).name} is missing"
    return RunSummary(
        folder.name, str(folder), Standing.UNREADABLE.value, what, "not known", None, Held.NOT_KNOWN.value,
        held=Held.NOT_KNOWN,
    )  # fmt: skip


def sound_result(folder: Path) -> JsonObject | None:
    """The run's result where it has one that can be read, and is of the form that was promised."""
    try:
        return read_result(folder)
    except DataRefused:
        return None


def read_file(path: Path) -> JsonObject:
    """The JSON object in the file; empty where there is none."""
    return read_document(path.read_text("utf-8", errors="replace")) if path.is_file() else {}


def _is_typed(summary: RunSummary) -> bool:
    texts = (
        "outcome", "reason", "drive", "written", "started_utc", "ended_utc", "person", "host", "version", "url", "profile", "motor_tag",
        "motor_serial", "motor_name", "held_utc",
    )  # fmt: skip
    return (
        all(isinstance(getattr(summary, name), str) for name in texts)
        and isinstance(summary.energised_s, int | float | None)
        and isinstance(summary.motor, dict)
        and isinstance(summary.parameters, dict)
        and all(map(_is_quantity, summary.parameters.values()))
        and isinstance(summary.serial_number, int | None)
        and isinstance(summary.lacks_result, bool)
    )


def _is_quantity(found: object) -> bool:
    return isinstance(found, dict) and isinstance(found.get("value"), int | float | None)


def _of(records: list[Record], kind: str) -> list[Record]:
    """What was journalled as `kind`, in order."""
    return [line["record"] for line in records if line["kind"] == kind and isinstance(line["record"], dict)]


def _text(record: Mapping[str, Any], key: str) -> str:
    value = record.get(key, "")
    return value if isinstance(value, str) else ""


def _mapping(value: object) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}


def _seconds(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None


def _drive(identity: Record) -> str:
    if not identity:
        return NOT_IDENTIFIED
    number = identity.get("serial_number")
    return (
        f"{identity.get('drive_type')} #{number}"
        if number
        else f"{identity.get('drive_type')}, serial number not known"
    )


def lacks_result(folder: Path, records: list[Record]) -> bool:
    """Whether the run measured and judged, and its process ended before it had kept what came of it; not where the result was there, and
    is gone."""
    ends = [end.get("outcome") for end in _of(records, "run_ended")]
    is_judged = ends[-1:] in ([Standing.COMMISSIONED], [Standing.REJECTED])
    return is_judged and not (folder / RESULT).exists() and RESULT not in as_closed(records)


def _reason(records: list[Record], end: Record, *, lacks: bool) -> str:
    """Why the run ended as it did; of one that did not come so far, how far it came."""
    said = _text(end, "reason") or _last_state(records)
    if not lacks:
        return said
    return f"{said}; {NO_RESULT}" + (CAN_BE_MADE if _of(records, "job") else "")


def _last_state(records: list[Record]) -> str:
    """How far a run came whose process ended before it could say so."""
    if _of(records, "parameters_written"):
        return "the process ended after the parameters had been written back"
    states = [record.get("state") for record in _of(records, "state_entered")]
    last = next((line["kind"] for line in reversed(records) if line["kind"] in _TUNINGS), "")
    if last in ("tuning_began", "tuned_once"):
        return "the process ended while the drive tuned itself: nothing but the drive's own supervision ends that, look at it"
    if last:
        return "the process ended after the drive had tuned itself"
    if states:
        return f"the process ended while {states[-1]}"
    return f"the process ended {'after' if _of(records, 'drive_identified') else 'before'} it connected"


_TUNINGS = ("tuning_began", "tuned_once", "tuning_ended", "tunings_judged")
"""Records of a tuning by the drive itself; another may begin after one has been done."""


class _Told(NamedTuple):
    """What the drive holds, in a sentence, and since when."""

    held: Held
    sentence: str
    utc: str = ""


def _told(records: list[Record]) -> _Told:
    """Old, new, or unknown, and since when: the last announcement or confirmation in the journal decides."""
    told = known = _Told(Held.AS_BEFORE, Held.AS_BEFORE.value)
    for line in records:
        kind, record = line["kind"], line["record"]
        if word := _word(kind, record):
            told = _Told(*word, _text(line, "utc"))
            known = told if told.held is not Held.OLD_OR_NEW else known
        elif kind == CALLED_OFF and isinstance(record, dict) and record.get("held") == known.held:
            told = known
        elif kind == "run_ended" and told.held is Held.RESTORED:
            told = known = _Told(Held.AS_BEFORE, GIVEN_BACK)  # by the run itself, as a tuning that only looks does
    return told


def _word(kind: str, record: Any) -> tuple[Held, str] | None:
    """What the drive holds from this record of the journal on; None of one that does not say."""
    if kind == "parameters_written":
        return Held.NEW, Held.NEW + _kept(record) + _wear(record)
    if kind == "snapshot_restored":
        return Held.RESTORED, Held.RESTORED + _wear(record)
    if kind == "about_to" and _touches_parameters(record):
        unknown = Held.OLD_OR_NEW
        return unknown, f"{unknown}{_mixed(record)}: read the drive, or `commissioner restore` this run"
    return None


def _mixed(intent: Mapping[str, Any]) -> str:
    """A drive that takes each value as it is written may hold some of both; one commit of a staged set, or none of it, leaves no such."""
    values = intent.get("values")
    is_one_by_one = intent.get("action") == "commit" and isinstance(values, dict) and "commit" not in values
    return ", or some of each" if is_one_by_one else ""


def _kept(report: Any) -> str:
    is_stored = not isinstance(report, dict) or report.get("is_stored", True)
    return ", read back and stored" if is_stored else ", read back; not stored, so lost at power-off"


def _wear(report: Any) -> str:
    """How much of the drive's non-volatile memory is used up, where the drive counts its writes."""
    facts = report if isinstance(report, dict) else {}
    used, endurance = facts.get("store_count_after"), facts.get("endurance_writes")
    return f"; {used} of {endurance} writes of the drive's memory used" if used and endurance else ""


def _touches_parameters(intent: Any) -> bool:
    return isinstance(intent, dict) and intent.get("action") in ("stage", "commit", "store", "tune")
