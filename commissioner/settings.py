"""Configuration files in, frozen dataclasses out. What is impossible is refused with file, key, value and remedy."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, ValidationError

from commissioner.encoding import JsonObject
from commissioner.errors import ConfigurationError, UsageError
from commissioner.motor.nameplate import Nameplate, check, connection_of
from commissioner.motor.space_vector import LEGS_ALIKE_DEG, is_aslant
from commissioner.paths import no_file, no_such_name
from commissioner.procedure.plan import Acceptance, ExcitationPlan, Limits, ProcedurePlan, Supervision
from commissioner.validation import FileTable, first_problem

CONFIG_FOLDER = Path(__file__).resolve().parent.parent / "config"
MAX_BYTES, MAX_DOTS = 250_000, 500
"""Of a TOML file, and in one line of it: the time that a dotted key takes grows with the square of its parts."""
_KEY, _NUMBER, _REST = r"(?P<key>[\w.-]{1,60})\s*", r"(?P<value>[+-]?\d{1,15}(?:\.\d{0,15})?)", r"\s*(?:#.*)?"
SLIPS: tuple[tuple[re.Pattern[str], str, str], ...] = tuple(
    (re.compile(pattern), what, right)
    for pattern, what, right in (
        (
            rf"{_KEY}=\s*(?P<value>[+-]?\d{{1,15}}),(?P<more>\d{{1,15}}){_REST}",
            "a decimal comma stands where TOML has a point", "{key} = {value}.{more}",
        ),
        (rf"{_KEY}:\s*(?P<value>[^=:]{{1,60}})", "a colon stands where TOML has =", "{key} = {value}"),
        (rf"{_KEY}=\s*{_NUMBER}\s*(?:[A-Za-z°%][\w/°%]{{0,10}}){_REST}", "a unit stands behind the number", "{key} = {value}"),
        (
            rf"{_KEY}=\s*[“”„‘’«»‚](?P<value>[^“”„‘’«»‚]{{0,60}})[“”„‘’«»‚]{_REST}",
            "a text stands in typographic quotes", '{key} = "{value}"',
        ),
        (rf"{_KEY}=\s*(?P<value>(?!(?:true|false|inf|nan)\b)[A-Za-z][\w -]{{0,60}}?){_REST}", "a text stands without quotes", '{key} = "{value}"'),
        (rf"{_KEY}={_REST}", "nothing stands behind the =", "{key} = ..."),
    )
)  # fmt: skip
"""What people write into a line in place of TOML: how it looks, what it is, how TOML writes it."""
UTF_16 = (b"\xff\xfe", b"\xfe\xff")

Percent = Annotated[float, Field(gt=0, le=100)]


class MotorFile(FileTable):
    """`config/motors/*.toml`: what the plate says."""

    name: str = ""
    rated_power_w: Annotated[float, Field(ge=20, le=20e6, description="watts at the shaft, 20 ... 20e6")]
    rated_voltage_v: Annotated[float, Field(ge=24, le=15e3, description="volts line-to-line rms, 24 ... 15000")]
    rated_frequency_hz: Annotated[float, Field(ge=5, le=1000, description="hertz, 5 ... 1000")]
    rated_current_a: Annotated[float, Field(ge=0.05, le=5e3, description="amperes line rms, 0.05 ... 5000")]
    rated_speed_rpm: Annotated[float, Field(ge=50, le=60e3, description="revolutions per minute, 50 ... 60000")]
    power_factor: Annotated[float, Field(gt=0.2, le=1, description="cos phi at rated load, 0.2 ... 1")]
    pole_pairs: Annotated[int, Field(ge=1, le=24, description="pole pairs (half the pole number), 1 ... 24")]
    connection: Annotated[
        Literal["star", "delta"],
        BeforeValidator(connection_of),
        Field(description="as it is wired: star (Y, wye) or delta (D, triangle)"),
    ] = "star"
    inertia_kg_m2: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None


def _testable(axis_deg: float) -> float:
    if is_aslant(axis_deg):
        raise ValueError(_TESTABLE)
    return axis_deg


_TESTABLE = f"multiples of {LEGS_ALIKE_DEG:g} deg: beside them the losses of the inverter's legs drive a current across the axis, and all values are off"
TestAngle = Annotated[float, Field(ge=-360, le=360), AfterValidator(_testable)]
"""An axis (electrical degrees) of a run to be. Earlier runs may hold another."""


class _Axes(FileTable):
    orientations_deg: Annotated[list[Annotated[float, Field(ge=-360, le=360)]], Field(min_length=1, max_length=12)]
    repeat_first: bool


class _Supervision(FileTable):
    watchdog_s: Annotated[float, Field(ge=0.1, le=2.0)]
    max_watchdog_s: Annotated[float, Field(ge=0.1, le=2.0)]
    standstill_dwell_s: Annotated[float, Field(ge=0.05, le=60)]
    reply_timeout_s: Annotated[float, Field(ge=0.02, le=5)]


class _Limits(FileTable):
    current_fraction: Annotated[float, Field(gt=0.05, le=1.2)]
    trip_fraction: Annotated[float, Field(gt=0.1, le=2.0)]
    flux_fraction: Annotated[float, Field(gt=0.1, le=0.98)]
    axis_time_s: Annotated[float, Field(gt=1, le=600)]
    total_time_s: Annotated[float, Field(gt=1, le=7200)]


class _Excitation(FileTable):
    seconds: Annotated[float, Field(ge=2, le=600)]
    staircase_seconds: Annotated[float, Field(ge=1, le=120)]
    first_scale: Annotated[float, Field(gt=0, le=0.5)]
    scale_ramp_per_s: Annotated[float, Field(gt=0, le=10)]


class _Acceptance(FileTable):
    resistance_std_percent: Percent
    leakage_std_percent: Percent
    rotor_resistance_std_percent: Percent
    magnetizing_std_percent: Percent
    axis_spread_percent: Percent
    strict: bool = False


class ProcedureFile(FileTable):
    """`config/procedure.toml`."""

    axes: _Axes
    supervision: _Supervision
    limits: _Limits
    excitation: _Excitation
    acceptance: _Acceptance


Model = TypeVar("Model", bound=BaseModel)


def load_motor(name_or_path: str) -> Nameplate:
    """The nameplate in `config/motors/NAME.toml` or in a file. ConfigurationError: the plate is impossible."""
    path = _resolve(name_or_path, "motors")
    return nameplate_of(read_toml(path), str(path))


def nameplate_of(document: JsonObject, source: str) -> Nameplate:
    """As `load_motor`, of what was read already."""
    model = _checked(document, MotorFile, source)
    nameplate = Nameplate(**model.model_dump(exclude={"name"}))
    for problem in check(nameplate):
        raise ConfigurationError(file=source, key=problem.key, value=problem.value, expected=problem.expected)
    return nameplate


def is_plate(name_or_path: str) -> bool:
    """Whether what `load_motor` would read is a nameplate, and not another file. UsageError: there is no such one."""
    path = Path(name_or_path) if Path(name_or_path).is_file() else _resolve(name_or_path, "motors")
    return path.suffix == ".toml" and "rated_power_w" in read_toml(path)


def load_procedure(
    path: Path | None = None, axes_deg: tuple[float, ...] | None = None, *, strict: bool = False
) -> ProcedurePlan:
    """The procedure's plan from `path` or from the file that ships with the product; `axes_deg` overrides its axes, `strict` its
    leniency. UsageError: no run can be made of it."""
    source = path or CONFIG_FOLDER / "procedure.toml"
    planned = plan_of(read_toml(source), str(source))
    acceptance = replace(planned.acceptance, strict=strict or planned.acceptance.strict)
    plan = replace(planned, axes_deg=axes_deg or planned.axes_deg, acceptance=acceptance)
    require_possible(plan, str(source))
    return plan


def require_possible(plan: ProcedurePlan, source: str) -> None:
    """UsageError: an axis on which nothing can be measured truly, or less time than the tests take; told before anything is energised."""
    for axis_deg in filter(is_aslant, plan.axes_deg):
        raise UsageError(
            f"axis {axis_deg:g} deg cannot be tested",
            step="read configuration",
            value=f"{axis_deg:g} deg",
            limit=_TESTABLE,
            remedy="test axes such as 0, 60 and 120 deg",
        )
    if plan.limits.total_time_s < plan.total_seconds:
        raise ConfigurationError(
            file=source, key="limits.total_time_s", value=plan.limits.total_time_s,
            expected=f"at least {plan.total_seconds:.0f} s, which {len(plan.tests_deg)} axis tests take",
        )  # fmt: skip


def plan_of(document: JsonObject, source: str) -> ProcedurePlan:
    """The plan that a procedure file's document makes, also one that an earlier run was made of and that is refused today."""
    model = _checked(document, ProcedureFile, source)
    must_agree(model, source)
    return ProcedurePlan(
        axes_deg=tuple(model.axes.orientations_deg),
        repeat_first=model.axes.repeat_first,
        supervision=Supervision(**model.supervision.model_dump()),
        limits=Limits(**model.limits.model_dump()),
        excitation=ExcitationPlan(**model.excitation.model_dump()),
        acceptance=Acceptance(**model.acceptance.model_dump()),
    )


def must_agree(model: ProcedureFile, source: str) -> None:
    """ConfigurationError where a value of the procedure cannot go with another."""
    for key, value, expected in _contradictions(model):
        raise ConfigurationError(file=source, key=key, value=value, expected=expected)


def _contradictions(model: ProcedureFile) -> Iterator[tuple[str, float, str]]:
    """Key, value and what would be right, where a value cannot go with another. How long a test takes depends on the motor;
    what is asked for here, every motor needs."""
    supervision, limits, tones_s = model.supervision, model.limits, model.excitation.seconds
    if supervision.watchdog_s > supervision.max_watchdog_s:
        expected = f"at most supervision.max_watchdog_s = {supervision.max_watchdog_s} s"
        yield "supervision.watchdog_s", supervision.watchdog_s, expected
    if limits.total_time_s < limits.axis_time_s:
        yield "limits.total_time_s", limits.total_time_s, f"at least limits.axis_time_s = {limits.axis_time_s} s"
    if tones_s >= limits.axis_time_s:
        yield "excitation.seconds", tones_s, f"less than limits.axis_time_s = {limits.axis_time_s} s"


def read_toml(path: Path) -> JsonObject:
    """The document in a TOML file of bounded size; a byte order mark before it, as Windows writes one, is no part of it."""
    if not path.is_file():
        raise no_file(path, "read configuration", "an existing TOML file")
    if path.stat().st_size > MAX_BYTES:
        raise ConfigurationError(
            file=str(path), key="(file)", value=f"{path.stat().st_size} bytes", expected=f"at most {MAX_BYTES} bytes"
        )
    held, text = path.read_bytes(), ""
    try:
        text = held.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
        if max(line.count(".") for line in text.split("\n")) > MAX_DOTS:
            raise ValueError(f"more than {MAX_DOTS} dots in a line")
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # syntax, encoding, digits without end, nesting without end
        raise ConfigurationError(
            file=str(path), key="syntax", value=str(error), expected="valid TOML in UTF-8" + _slip(held, text)
        ) from error


def _slip(held: bytes, text: str) -> str:
    """The first line that is no TOML for a reason that people have, and how TOML writes it; nothing where none is found."""
    if held and not text:
        kind = (
            "is UTF-16, which Windows calls Unicode"
            if held.startswith(UTF_16)
            else f"is in another encoding{_since(held)}"
        )
        return f"; the file {kind}: save it as UTF-8"
    for number, line in enumerate(text.splitlines(), 1):
        for pattern, what, right in SLIPS:
            if (found := pattern.fullmatch(line.strip())) and not _is_toml(line):
                return f"; in line {number} {what}: {right.format(**found.groupdict())}"
    return ""


def _since(held: bytes) -> str:
    """The line of the first byte that is not UTF-8, counted as an editor does."""
    try:
        held.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        return f", seen in line {held[: error.start].count(10) + 1}"
    return ""


def _is_toml(line: str) -> bool:
    """`0x10` and `1e5` are numbers, not numbers with a unit behind."""
    try:
        return bool(tomllib.loads(line))
    except ValueError:
        return False


def _resolve(name_or_path: str, folder: str) -> Path:
    """A path as given, else a name in the product's configuration folder."""
    if name_or_path.endswith(".toml") or "/" in name_or_path:
        return Path(name_or_path)
    shipped = CONFIG_FOLDER / folder / f"{name_or_path}.toml"
    if not shipped.is_file():
        raise no_such_name(folder[:-1], name_or_path, [path.stem for path in (CONFIG_FOLDER / folder).glob("*.toml")])
    return shipped


def load(path: Path, model: type[Model]) -> Model:
    """ConfigurationError with file, key, value and what would be right."""
    return _checked(read_toml(path), model, str(path))


def _checked(document: JsonObject, model: type[Model], source: str) -> Model:
    try:
        return model.model_validate(document)
    except ValidationError as error:
        problem = first_problem(error, model)
        raise ConfigurationError(
            file=source, key=problem.key, value=problem.value, expected=problem.expected
        ) from error
