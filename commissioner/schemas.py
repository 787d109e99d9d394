"""JSON schemas of what leaves the program, from the types: `python -m commissioner.schemas` writes them into the manual's folder."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, NotRequired

from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema
from typing_extensions import TypedDict

from commissioner import docs
from commissioner.cli.verbs.archived.motors import KnownMotors, LikelyMotors
from commissioner.cli.verbs.archived.moving import MovedRuns
from commissioner.cli.verbs.archived.runs import ShownRun
from commissioner.cli.verbs.archived.verify import VerifiedRuns
from commissioner.cli.verbs.drives.conformance import ConformanceDocument
from commissioner.cli.verbs.drives.files import DriveRow
from commissioner.cli.verbs.ports import FoundAdapters
from commissioner.cli.verbs.serve import KnownAccounts
from commissioner.diagnose.contract import DiagnosisDocument
from commissioner.diagnose.export.contract import ModelDocument
from commissioner.encoding import JsonObject, plain
from commissioner.identify.contract import AnyIdentification
from commissioner.monitor.contract import MonitoringDocument, PartialMonitoring, RefusedMonitoring
from commissioner.operations.archive import Exported, ReplayedRun, Reported
from commissioner.operations.export import ExportedModel
from commissioner.operations.history.compare import Held
from commissioner.operations.history.motors import Named
from commissioner.operations.history.runs import WrittenTable
from commissioner.operations.history.trend import MotorTrend
from commissioner.operations.recordings.simulate import Simulated
from commissioner.recordings.imported import Understood
from commissioner.report.run.contract import RunDocument, WritePlan
from commissioner.run.archive.summary import RunSummary
from commissioner.run.archive.verify import Verified
from commissioner.run.index.index import Refreshed
from commissioner.run.tuning.tune import TuneDocument
from commissioner.running.export import RunningModel
from commissioner.service.contract.drives import CheckDocument
from commissioner.service.contract.history import ComparedDocument
from commissioner.service.contract.recordings import FailedVerb
from commissioner.service.contract.writing import RestoredDocument, WrittenDocument
from commissioner.study.campaign import Studied
from commissioner.study.rows import Row


class EndedRun(RunDocument):
    """`folder`: where it lies, in what is printed."""

    folder: NotRequired[str]


class TunedRun(EndedRun):
    """As any run; `tune`: what the drive found by itself."""

    tune: TuneDocument


class ListedRuns(TypedDict):
    """Newest first, without their results; `total`: how many there are beyond a limit."""

    runs: list[RunSummary]
    total: int


SCHEMAS: Mapping[str, Any] = {
    "accounts": KnownAccounts,
    "check": CheckDocument,
    "conformance": ConformanceDocument,
    "diagnose": DiagnosisDocument,
    "drives_list": list[DriveRow],
    "drives_show": DriveRow,
    "drives_validate": DriveRow,
    "failure": FailedVerb,
    "identify": AnyIdentification,
    "model": ModelDocument | RunningModel,
    "monitor": MonitoringDocument | PartialMonitoring | RefusedMonitoring,
    "ports": FoundAdapters,
    "recordings_import": Understood,
    "replay": ReplayedRun,
    "restore": RestoredDocument,
    "run": EndedRun,
    "runs_compare": ComparedDocument | Held,
    "runs_export": Exported | ExportedModel,
    "runs_index": Refreshed,
    "runs_list": ListedRuns,
    "runs_motors": KnownMotors | LikelyMotors | Named,
    "runs_moved": MovedRuns,
    "runs_report": Reported,
    "runs_show": ShownRun,
    "runs_table": WrittenTable,
    "runs_trend": MotorTrend,
    "runs_verify": Verified | VerifiedRuns,
    "simulate": Simulated,
    "study": Studied,
    "study_row": Row,
    "tune": TunedRun,
    "write_back": WrittenDocument,
    "write_plan": WritePlan,
}
"""Type of each document, by the verb that prints it or the file that holds it."""


class AsEncoded(GenerateJsonSchema):
    """What `encoding.plain` makes of a record: no hidden field; null for a number that is none; the name of a choice."""

    def enum_schema(self, schema: Any) -> JsonObject:
        made: JsonObject = super().enum_schema(schema)
        return made | {"type": "string", "enum": [plain(one) for one in schema["members"]]}

    def dataclass_schema(self, schema: Any) -> JsonObject:
        made: JsonObject = super().dataclass_schema(schema)
        for hidden in (field.name for field in fields(schema["cls"]) if field.metadata.get("is_hidden")):
            del made["properties"][hidden]
            made["required"].remove(hidden)
        return made

    def dataclass_field_schema(self, schema: Any) -> JsonObject:
        made: JsonObject = super().dataclass_field_schema(schema)
        return made | {"type": ["number", "null"]} if made.get("type") == "number" else made


def schema_of(name: str) -> JsonObject:
    """JSON Schema 2020-12 of one document. A key that is not in it may be there: more may be added. KeyError: no such document."""
    made = TypeAdapter[Any](SCHEMAS[name]).json_schema(schema_generator=AsEncoded)
    return {"$schema": GenerateJsonSchema.schema_dialect, "title": name} | made


def text_of(name: str) -> str:
    """As it is shipped."""
    return json.dumps(schema_of(name), indent=1, sort_keys=True) + "\n"


def write(folder: Path) -> None:
    """Every schema as a file of the folder; files of documents that are no more are removed."""
    folder.mkdir(exist_ok=True)
    for old in folder.glob(f"*{docs.SCHEMA_ENDING}"):
        old.unlink()
    for name in SCHEMAS:
        (folder / f"{name}{docs.SCHEMA_ENDING}").write_text(text_of(name), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    write(Path(docs.__file__).with_name(docs.SCHEMAS))
