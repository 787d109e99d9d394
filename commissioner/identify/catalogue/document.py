"""An answer as the JSON that `identify` gives, and the sentences of what a sheet can and cannot tell."""

from __future__ import annotations

from commissioner.identify.catalogue.answer import UNMET, Answer, Row, Stated
from commissioner.identify.catalogue.sheet import KEYS
from commissioner.identify.contract import SheetDocument, SheetValue, StatedValue
from commissioner.identify.document import CONVENTION

KIND = "manufacturer's sheet"
METHOD = "double-cage circuit that meets the sheet (Pedra and Corcoles 2004, doi:10.1109/TEC.2003.822314); errors linearised at it"
WORDS = {
    "stator_resistance_ohm": "R_s", "rotor_resistance_ohm": "R_R", "leakage_inductance_h": "L_sigma", "magnetizing_inductance_h": "L_M",
}  # fmt: skip


def document(found: Answer) -> SheetDocument:
    """Plain JSON types. `std` of a parameter is that of a motor of this type, `std_of_type` without the tolerances."""
    return {
        "outcome": "identified",
        "reason": "The circuit that meets the values of a manufacturer's sheet.",
        "kind": KIND,
        "method": METHOD,
        "convention": CONVENTION,
        "parameters": {k: _stated(v) for k, v in found.parameters.items()},
        "holds_for_stator_flux_wb": found.stator_flux_wb,
        "withheld": dict(found.withheld),
        "t_circuit": {k: _stated(v) for k, v in found.t_circuit.items()},
        "double_cage": {k: _stated(v) for k, v in found.cages.items()},
        "losses": {k: _stated(v) for k, v in found.losses.items()},
        "values": [_met(row) for row in found.rows],
        "assumed": found.assumed,
        "nameplate": None if found.plate is None else found.plate.known(),
        "remarks": remarks(found),
    }


def remarks(found: Answer) -> list[str]:
    """What was decided, what is not met, what a sheet cannot tell."""
    out = list(found.sheet.remarks)
    out += [
        f"{WORDS[name]} is withheld: the sheet does not tell it; it would need {need}."
        for name, need in found.withheld.items()
    ]
    unmet = [row for row in found.rows if abs(row.reproduced / row.given - 1.0) > UNMET]
    out += [
        f"{KEYS[r.key][0]}: {r.given:.4g} on the sheet, {r.reproduced:.4g} of the circuit"
        + (
            ": no circuit meets all values to their digits, the errors are larger for it."
            if r.is_fitted
            else " (not used)."
        )
        for r in unmet
    ]
    if not found.cages:
        has_start = found.sheet.has("starting_current_ratio", "starting_torque_ratio")
        why = (
            "two cages cannot be told apart"
            if has_start
            else "starting current and torque are not both there, the start is not described"
        )
        out.append(f"One cage, as it is at rated slip: {why}.")
    if found.assumed:
        taken = "; ".join(f"{one.words} (within a factor of {one.factor:.2f}; {one.source})" for one in found.assumed)
        out.append(f"Not told by the sheet and taken as other motors have it: {taken}.")
    return [
        *out,
        "The sheet is of the type: a motor of it may differ within the tolerances of IEC 60034-1, which the error holds (std_of_type: without).",
        "R_s is warm (about 85 degC); L_M holds at the rated flux. No sheet tells iron that bends, bars over frequency beyond two cages, or "
        "anything of the inverter: a measurement does.",
    ]  # fmt: skip


def _met(row: Row) -> SheetValue:
    name, unit = KEYS[row.key]
    return {
        "key": row.key, "given": row.given, "reproduced": row.reproduced, "is_fitted": row.is_fitted, "name": name, "unit": unit,
    }  # fmt: skip


def _stated(value: Stated) -> StatedValue:
    return {
        "value": value.value, "std": value.std, "std_of_type": value.of_type,
        "from": {"rounding": value.rounding, "assumptions": value.assumptions, "tolerances": value.tolerances},
    }  # fmt: skip
