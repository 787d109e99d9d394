"""What `commissioner drives new` asks: registers as the manual prints them, values as label and keypad show them."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TypeVar

import click
import typer

from commissioner.errors import LinkError, UsageError
from commissioner.link.drive.ordinary.probing import Known, Reading
from commissioner.records import plain_name
from commissioner.registers.contradictions import UNITS_OF_QUANTITY
from commissioner.registers.convention import CIRCUITS, INDUCTANCES, RESISTANCES
from commissioner.registers.status import STATUS_BITS

LABELS = {
    "rated_voltage_v": ("V", "rated voltage of the motor"),
    "rated_current_a": ("A", "rated current of the motor"),
    "rated_frequency_hz": ("Hz", "rated frequency of the motor"),
    "rated_speed_rpm": ("1/min", "rated speed of the motor"),
    "rated_power_w": ("W", "rated power of the motor"),
    "dc_link_v": ("V", "DC link voltage, as its display shows it now"),
}
FEWEST = 2
"""One value may fit by chance; two that agree on one address base seldom do."""
PARAMETERS = (*RESISTANCES, *INDUCTANCES, "rotor_time_constant")
UNITS = {
    "ohm": ("ohm", 1.0), "mohm": ("ohm", 1e-3), "h": ("H", 1.0), "mh": ("H", 1e-3), "s": ("s", 1.0), "ms": ("s", 1e-3),
    "%": ("%", 1.0),
}  # fmt: skip
"""As a keypad shows it -> the unit of a drive file, and what is one of it there."""
STATOR, PHASES = "stator_resistance", ("per_phase", "line_to_line")

NOT_SEEN = (
    "tried as a holding register of u16, i16, u32 or f32, either word order, counted from 0, from 1 or as 4xxxx, scales of ten; a "
    "value on the label may not be set in the drive, and input registers (3xxxx, function 4) are not read: look for the holding "
    "register that shows the same"
)

Answer = TypeVar("Answer")
See = Callable[[Known], Sequence[Reading]]
"""Every way by which the drive shows a value that is known."""


@dataclass(frozen=True)
class Parameter:
    """A motor parameter; `known` in the unit that the keypad shows, of which one is `factor` in `unit`."""

    known: Known
    unit: str
    factor: float
    convention: str

    @property
    def needs_rated(self) -> bool:
        """A reactance or a per cent is so of one motor only."""
        return self.convention.endswith(("frequency", "impedance"))


@dataclass(frozen=True)
class Status:
    """The status word; `bits` empty: CiA 402."""

    printed: int
    bits: dict[str, int]
    source: str

    @property
    def decoder(self) -> str:
        return "bits" if self.bits else "cia402"


@dataclass(frozen=True)
class Keeping:
    """The write by which values outlast a power-off."""

    printed: int
    value: int


@dataclass(frozen=True)
class Answers:
    """All that a person said about a drive."""

    name: str
    source: str
    labels: tuple[Known, ...]
    parameters: tuple[Parameter, ...] = ()
    status: Status | None = None
    keeping: Keeping | None = None
    tuning_page: str = ""

    @property
    def known(self) -> tuple[Known, ...]:
        return (*self.labels, *(p.known for p in self.parameters))


def answers(see: See) -> Answers:
    """Asked on stderr; what `see` finds nowhere in the drive is asked again. UsageError: too little to prove anything."""
    name, source = text("Name of the drive"), text("Document or manual with its register table")
    labels = tuple(
        seen
        for key, (unit, words) in LABELS.items()
        if sure(f"Is the register of the {words} in the manual?")
        and (seen := _known(key, source, see, f"  its value in {unit}", value_in(unit)))
    )
    if len(labels) < FEWEST:
        raise UsageError(
            "too little to prove an address base", step="drives new", value=len(labels), limit=f"at least {FEWEST} values",
            remedy="look up one more register whose value stands on the label or the display",
        )  # fmt: skip
    if not sure("Are registers of the motor's resistances, inductances or time constant in the manual?"):
        return Answers(name, source, labels)
    parameters = _parameters(source, see)
    status, keeping, tuning = _status(source), _keeping(), ""
    if parameters:
        tuning = text("Page of its own tuning at standstill (empty: none)", default="")
    return Answers(name, source, labels, parameters, status, keeping, tuning)


def _known(name: str, source: str, see: See, words: str, read: Callable[[str], tuple[float, str]]) -> Known | None:
    """A register and its value, once the drive has shown it; None: given up."""
    while True:
        printed, (value, unit) = register(), ask(words, read)
        known = Known(name, printed, value, unit, page(source))
        why = f"no reading of register {printed} gives {value:g} {unit}: {NOT_SEEN}"
        try:
            if see(known):
                return known
        except LinkError as silent:
            why = f"{silent.what}: {silent.remedy}"
        typer.echo(f"  {why}", err=True)
        if not sure("  Once more?"):
            return None


def _parameters(source: str, see: See) -> tuple[Parameter, ...]:
    """Each as the keypad shows it now, in the circuit of the manual."""
    words = "  its value and unit, as the keypad shows it now (3.2 ohm, 13 mH)"
    asked = [
        seen
        for name in PARAMETERS
        if sure(f"  {plain_name(name)}?") and (seen := _known(name, source, see, words, quantity_of(name)))
    ]
    if not asked:
        return ()
    names = {known.name for known in asked}
    circuit = choice("Circuit of these values", CIRCUITS) if names - {STATOR, "rotor_time_constant"} else CIRCUITS[0]
    counted = (
        choice("Stator resistance of one phase, or between two terminals", PHASES) if STATOR in names else PHASES[0]
    )
    return tuple(
        Parameter(known, *UNITS[known.unit.lower()], _convention(known.name, known.unit, circuit, counted))
        for known in asked
    )


def _convention(name: str, shown: str, circuit: str, counted: str) -> str:
    """By quantity and unit; only the stator's resistance is counted between terminals."""
    unit = UNITS[shown.lower()][0]
    if name == "rotor_time_constant":
        return "time_constant"
    if unit == "%":
        return f"{circuit}_percent_of_base_impedance"
    if name in INDUCTANCES and unit == "ohm":
        return f"{circuit}_reactance_at_rated_frequency"
    return f"{circuit}_{counted if name == STATOR else PHASES[0]}"


def _status(source: str) -> Status | None:
    if not sure("Is the register of the status word in the manual?"):
        return None
    printed = register()
    if sure("  Are its bits those of CiA 402?"):
        return Status(printed, {}, page(source))
    bits = {name: ask(f"  bit that is 1 when: {name} (0 ... 15)", bit) for name in STATUS_BITS}
    return Status(printed, bits, page(source))


def _keeping() -> Keeping | None:
    if not sure("Is there a register by which parameters outlast a power-off?"):
        return None
    return Keeping(register(), ask("  the value written to it", whole))


def sure(words: str) -> bool:
    return typer.confirm(words, err=True)


def text(words: str, default: str | None = None) -> str:
    said: str = typer.prompt(words, default=default, show_default=False, err=True)
    return said.strip()


def ask(words: str, read: Callable[[str], Answer]) -> Answer:
    """What `read` makes of the answer; after a BadParameter it is asked again."""
    answer: Answer = typer.prompt(words, value_proc=read, err=True)
    return answer


def choice(words: str, among: tuple[str, ...]) -> str:
    said: str = typer.prompt(words, type=click.Choice(list(among)), err=True)
    return said


def page(source: str) -> str:
    return f"{source}, {text('  page')}"


def register() -> int:
    return ask("  its register as printed (decimal, or 0x...)", whole)


def whole(said: str) -> int:
    """As printed; leading zeros are no octal number."""
    try:
        return int(said, 16 if said.strip().lower().startswith("0x") else 10)
    except ValueError:
        raise typer.BadParameter(f"{said!r} is no register: write it as 1220, 40101 or 0x31A") from None


def bit(said: str) -> int:
    if said.strip().isdecimal() and int(said) < 16:
        return int(said)
    raise typer.BadParameter(f"{said!r} is no bit: 0 is the lowest, 15 the highest")


def above_zero(said: str) -> float:
    """A value that proves something: zero stands in registers that nobody uses."""
    with suppress(ValueError):
        value = float(said.strip().replace(",", "."))
        if 0.0 < value < math.inf:
            return value
    raise typer.BadParameter(f"{said!r} is no value above zero: write it as 400 or 5.1")


def value_in(unit: str) -> Callable[[str], tuple[float, str]]:
    """Reads a number of this unit."""
    return lambda said: (above_zero(said), unit)


def quantity_of(name: str) -> Callable[[str], tuple[float, str]]:
    """Reads number and unit, as a keypad shows them, of a quantity that has such a unit."""

    def read(said: str) -> tuple[float, str]:
        parts = re.fullmatch(r"\s*([\d.,]+)\s*([A-Za-zΩ%]+)\s*", said)
        shown = parts[2].replace("Ω", "ohm") if parts else ""
        if parts is None or UNITS.get(shown.lower(), ("", 0.0))[0] not in UNITS_OF_QUANTITY[name]:
            raise typer.BadParameter(
                f"{said!r} is no {plain_name(name)} with its unit: write it as 3.2 ohm, 13 mH, 140 ms or 2.1 %"
            )
        return above_zero(parts[1]), shown

    return read
