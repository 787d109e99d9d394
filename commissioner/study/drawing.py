"""A case's motor and drive, as the simulator draws them; without the engine that commissions them, for who only asks whether they can be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from commissioner.errors import ConfigurationError
from commissioner.motor.nameplate import Nameplate
from commissioner.study.simulators import Drawn, simulator
from commissioner.study.specification import Case


def require_drawable(cases: Sequence[Case], file: Path) -> None:
    """ConfigurationError: what the study asks for can be drawn for none of its motors, as where an effect is misspelt."""
    said, asked = "", ""
    for case in {one.motor: one for one in reversed(cases) if one.kind == "commission"}.values():
        try:
            draw(case)
            return
        except ValueError as error:
            said, asked = str(error), ", ".join(sorted({*case.effects, *case.faults} - {"none"})) or case.motor
    if said:
        raise ConfigurationError(
            file=str(file), key="motors, effects or faults", value=asked, expected=f"what the simulator knows; {said}"
        )


def draw(case: Case) -> Drawn:
    """ValueError: it cannot be, as a fault that only a line can have where there is none."""
    drawn = simulator().draw(
        _typical(case.motor, case.plate) if case.plate else case.motor,
        case.seed,
        spread=case.spread,
        effects=case.effects,
        noise_a=case.noise_a,
        faults=case.faults,
    )
    _ = drawn.station if case.links == "memory" else None  # made here, where its ValueError is caught
    return drawn


def _typical(motor: str, plate: Nameplate) -> Mapping[str, Any]:
    # every cause comes with it, half a second for a study without plates
    from commissioner.diagnose.export.scenario import typical_motor

    return typical_motor(motor, plate)
