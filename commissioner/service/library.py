"""The drives, motors and procedures that can be chosen: packaged, configured, or added on the page."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from commissioner.encoding import JsonObject, read_json
from commissioner.errors import CommissionerError, UsageError
from commissioner.motor.nameplate import Nameplate, check, plate_doubt
from commissioner.recordings.whole import write_text
from commissioner.service.configuration import DriveTable, Settings
from commissioner.service.contract.plates import JudgedField, JudgedPlate
from commissioner.service.problems import Refusal, Unknown
from commissioner.settings import (
    CONFIG_FOLDER,
    MotorFile,
    ProcedureFile,
    load_motor,
    plan_of,
    read_toml,
    require_possible,
)
from commissioner.text import did_you_mean
from commissioner.validation import requirement

LEAST_RUN_UP_S, LONGEST_RUN_UP_S = 0.003, 300.0
"""To rated speed at rated torque: rotors alone take 0.03 ... 2 s, a fan or a centrifuge a hundred times that."""
OF_INERTIA = "is the moment of inertia in kg m²?"
SIMULATOR, STANDARD = "simulator", "standard"
PLATE_FIELDS = tuple(name for name in MotorFile.model_fields if name != "name")
TYPICAL_EFFICIENCY = ((500.0, 0.45, 0.80), (3e3, 0.65, 0.90), (30e3, 0.78, 0.955), (math.inf, 0.86, 0.98))
"""Up to a rated power: the efficiencies of ordinary motors, IE1 (IEC 60034-30-1) less some points to the best sold."""


@dataclass(frozen=True)
class Drive:
    """`origin`: configured | added | packaged (the simulator)."""

    id: str
    name: str
    url: str
    profile: str
    origin: str


@dataclass(frozen=True)
class Motor:
    """`source`: what `--motor` takes."""

    id: str
    name: str
    source: str
    origin: str
    plate: Nameplate


@dataclass(frozen=True)
class Procedure:
    """`origin`: packaged | added."""

    id: str
    path: Path
    origin: str


Known = TypeVar("Known", Drive, Motor, Procedure)


class Library:
    """What there is to choose from. Added drives and motors are files in the service's own folder."""

    def __init__(self, settings: Settings) -> None:
        self._configured = settings.file.drives
        self._data = settings.data
        self.simulator_url: str | None = None

    def drives(self) -> list[Drive]:
        configured = [Drive(d.id, d.name, d.url, d.profile, "configured") for d in self._configured]
        added = [Drive(**table, origin="added") for table in map(_read_json, self._files("drives", "json")) if table]
        simulator = Drive(SIMULATOR, "Simulator", self.simulator_url or "", "simulated", "packaged")
        return [*configured, *added, simulator]

    def drive(self, identifier: str) -> Drive:
        """UsageError where there is none of this id."""
        return _found(self.drives(), identifier, "drive")

    def known_drive(self, identifier: str) -> Drive | None:
        """None where there is none of this id."""
        return next((drive for drive in self.drives() if drive.id == identifier), None)

    def add_drive(self, table: DriveTable) -> Drive:
        """Check and keep. UsageError: address or drive file cannot be right, or the id is taken."""
        from commissioner.link.files.drive_file import load_profile
        from commissioner.link.wire.url import parse_url

        _must_be_new([d.id for d in self.drives()], table.id)
        parse_url(table.url)
        load_profile(table.profile)
        _write(self._data / "drives" / f"{table.id}.json", json.dumps(table.model_dump(), indent=1))
        return self.drive(table.id)

    def motors(self) -> list[Motor]:
        """Added ones first."""
        added = [_motor(path, str(path), "added") for path in self._files("motors", "toml")]
        packaged = [_motor(path, path.stem, "packaged") for path in sorted((CONFIG_FOLDER / "motors").glob("*.toml"))]
        return [motor for motor in (*added, *packaged) if motor is not None]

    def motor(self, identifier: str) -> Motor:
        return _found(self.motors(), identifier, "motor")

    def put_motor(self, identifier: str, table: MotorFile) -> Motor:
        """Keep a motor's plate, new or changed. UsageError: the plate contradicts itself, or the id is a packaged one's."""
        plate = Nameplate(**table.model_dump(exclude={"name"}))
        for problem in check(plate):
            raise UsageError(
                f"{problem.key} contradicts the rest of the plate", step="nameplate", value=problem.value,
                limit=problem.expected, remedy="read the plate again",
            )  # fmt: skip
        _must_be_new([m.id for m in self.motors() if m.origin == "packaged"], identifier)
        _write(self._data / "motors" / f"{identifier}.toml", _toml(table.model_dump()))
        return self.motor(identifier)

    def procedures(self) -> list[Procedure]:
        """The one that ships with the product first."""
        added = [Procedure(path.stem, path, "added") for path in self._files("procedures", "toml")]
        return [Procedure(STANDARD, CONFIG_FOLDER / "procedure.toml", "packaged"), *added]

    def procedure(self, identifier: str) -> Procedure:
        return _found(self.procedures(), identifier, "procedure")

    def put_procedure(self, identifier: str, table: ProcedureFile) -> Procedure:
        """Keep a procedure, new or changed. UsageError: its values contradict each other, no run can be made of it, or the id is the packaged one's."""
        source = f"procedure {identifier}"
        require_possible(plan_of(table.model_dump(), source), source)
        _must_be_new([STANDARD], identifier)
        tables = (f"[{name}]\n{_toml(values)}" for name, values in table.model_dump().items())
        _write(self._data / "procedures" / f"{identifier}.toml", "\n".join(tables))
        return self.procedure(identifier)

    def profiles(self) -> list[str]:
        """Names of the drive files that ship with the product."""
        return sorted(path.stem for path in (CONFIG_FOLDER / "drives").glob("*.toml"))

    def _files(self, folder: str, ending: str) -> list[Path]:
        return sorted((self._data / folder).glob(f"*.{ending}"))


def must_be_there(drive: Drive, step: str, remedy: str = "start the simulator first") -> None:
    """Refusal 409 where the drive has no address yet: the simulator before its start."""
    if not drive.url:
        raise Refusal(
            409,
            "the simulator is not running",
            step=step,
            value=drive.id,
            limit="a drive with an address",
            remedy=remedy,
        )


def judge_plate(values: Mapping[str, Any]) -> JudgedPlate:
    """Each field of a plate: ok, or what is wrong and what to do; then what the whole plate implies."""
    fields: dict[str, JudgedField] = {name: {"ok": True, "what": "", "remedy": ""} for name in PLATE_FIELDS}
    numbers = {key: number_of(values[key]) for key in values if key in {*PLATE_FIELDS, "name"}}
    try:
        table = MotorFile.model_validate(numbers)
    except ValidationError as error:
        for problem in error.errors():
            name = str(problem["loc"][0])
            described = MotorFile.model_fields[name].description if name in MotorFile.model_fields else None
            missing = problem["type"] == "missing" or values.get(name) in (None, "")
            what = "is missing" if missing else f"must be {requirement(problem)}"
            if name in fields:
                fields[name] = {"ok": False, "what": what, "remedy": described or "read the plate again"}
        return {"ok": False, "fields": fields, "efficiency": None, "usual_efficiency": None, "questions": []}
    plate = Nameplate(**table.model_dump(exclude={"name"}))
    for contradiction in check(plate):
        fields[contradiction.key] = {
            "ok": False,
            "what": "contradicts the rest of the plate",
            "remedy": contradiction.expected,
        }
    efficiency = plate.efficiency
    return {
        "ok": all(field["ok"] for field in fields.values()), "fields": fields, "efficiency": round(efficiency, 4),
        "usual_efficiency": usual_efficiency(plate), "slip": round(plate.rated_slip, 5), "questions": questions(plate),
    }  # fmt: skip


def usual_efficiency(plate: Nameplate) -> tuple[float, float]:
    """What motors of this power have."""
    return next((low, high) for power, low, high in TYPICAL_EFFICIENCY if plate.rated_power_w <= power)


def questions(plate: Nameplate) -> list[str]:
    """What a plate that is possible but unusual should be asked."""
    run_up_s = plate.run_up_s
    is_odd = run_up_s is not None and not LEAST_RUN_UP_S < run_up_s < LONGEST_RUN_UP_S
    return [*_of_efficiency(plate), *([OF_INERTIA] if is_odd else [])]


def _of_efficiency(plate: Nameplate) -> list[str]:
    low, high = usual_efficiency(plate)
    efficiency = plate.efficiency
    if low <= efficiency <= high and not plate_doubt(plate):
        return []
    if low <= efficiency * math.sqrt(3) <= high:
        return ["star voltage with delta current?"]
    if low <= efficiency / math.sqrt(3) <= high:
        return ["delta voltage with star current?"]
    if low <= efficiency * math.sqrt(2) <= high:
        return ["a power in kW taken for one in hp, or a peak current?"]
    return ["is a number misread?"]


def number_of(value: Any) -> Any:
    """Text as a plate is typed: decimal comma or point."""
    if not isinstance(value, str):
        return value
    text = value.strip().replace("\u00a0", "").replace(" ", "")
    if re.fullmatch(r"[+-]?\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?", text):
        number = float(text.replace(",", "."))
        return int(number) if number == int(number) and abs(number) < 1e15 else number
    return value.strip() or None


def _motor(path: Path, source: str, origin: str) -> Motor | None:
    """A file that somebody broke by hand is no motor to choose."""
    try:
        plate = load_motor(str(path))
        return Motor(path.stem, str(read_toml(path).get("name") or path.stem), source, origin, plate)
    except CommissionerError:
        return None


def _found(known: list[Known], identifier: str, what: str) -> Known:
    for one in known:
        if one.id == identifier:
            return one
    asked, ids = identifier[:60], [one.id for one in known]
    raise Unknown(
        what, f"there is no {what} {asked!r}" + did_you_mean(asked, ids), step="choose", value=asked,
        limit="one of: " + ", ".join(ids), remedy=f"choose one of these, or add the {what} first",
    )  # fmt: skip


def _must_be_new(taken: list[str], identifier: str) -> None:
    if identifier in taken:
        raise UsageError(f"the id {identifier!r} is taken", step="add", value=identifier, limit="a new id",
                         remedy="choose another id")  # fmt: skip


def _read_json(path: Path) -> JsonObject | None:
    try:
        return DriveTable.model_validate(read_json(path.read_text("utf-8"))).model_dump()
    except ValueError:
        return None


def _toml(values: Mapping[str, object]) -> str:
    """A line for each value that is said."""
    return "".join(f"{key} = {json.dumps(value)}\n" for key, value in values.items() if value is not None)


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    write_text(path, text)
