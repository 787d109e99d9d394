"""The result document of a run: the contract's keys, from what the run found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, cast

from commissioner.identify.document import document as identification_document
from commissioner.motor.circuit import PARAMETERS
from commissioner.procedure.findings import RunEnded
from commissioner.procedure.steps import Findings
from commissioner.report.run.contract import RunDocument, WrittenRow


def summarise(
    findings: Findings, ended: RunEnded, run: str, names: Mapping[str, str], factors: Mapping[str, float]
) -> RunDocument:
    """What `run --json` prints and `result.json` holds. `names`: the drive's name of a parameter -> the contract's;
    `factors`: by what the drive multiplies the SI value, where that is not 1."""
    identification = findings.identification
    document: dict[str, Any] = {
        "run": run,
        "outcome": ended.outcome,
        "reason": ended.reason,
        "error": ended.error,
        "energised_s": ended.energised_s,
        "duration_s": ended.energised_s,
        "drive": findings.identity,
        "checks": findings.checks,
        "before": _before(findings, names, factors),
        "written": _written(findings, names, factors),
        "objections": findings.verdict.objections if findings.verdict else (),
        "parameters": {},
        "remarks": (),
        "diagnosis": None,
    }
    if identification is not None:
        document |= {
            key: value
            for key, value in identification_document(identification).items()
            if key not in ("outcome", "reason", "duration_s")
        }
        document |= _more(findings, document["remarks"])
    document["flux_guard"] = {
        "peak_fraction": findings.peak_flux_fraction,
        "acted": findings.guard_acted,
        "limit_wb": findings.flux_limit_wb,
    }
    return cast("RunDocument", document)


def diagnosis_sentences(diagnosis: Mapping[str, Any], parameters: Mapping[str, Any]) -> list[str]:
    """What the diagnosis of the run's samples means for the run's `parameters`, a sentence each."""
    names = [" or ".join((c["name"], *c["equivalent"])).replace("_", " ") for c in diagnosis["causes"]]
    out = []
    if not diagnosis.get("is_complete", True):
        out.append(
            "the diagnosis of the samples was stopped before every cause was tried, when its time was over; the parameters "
            "do not depend on it. `commissioner diagnose` on the run's recording.parquet finishes it"
        )
    if names:
        out.append(f"a simulation with the four parameters alone misses, in these samples: {', '.join(names)}")
    for moved in diagnosis["moved"]:
        unit, factor = ("ohm", 1.0) if moved["parameter"].endswith("_ohm") else ("mH", 1e3)
        name = moved["parameter"].rpartition("_")[0].replace("_", " ")
        out.append(
            f"without them {name} would have come out as {factor * moved['four_parameters']:.4g} {unit} instead of "
            f"{factor * parameters[moved['parameter']]['value']:.4g} {unit}, mostly for {moved['cause'].replace('_', ' ')}"
        )
    return out


def _more(findings: Findings, remarks: Sequence[str]) -> dict[str, Any]:
    """The winding's temperature, and what a longer test would buy: in numbers, and as a remark."""
    longer, match = findings.longer_test, findings.plate_match
    more: dict[str, Any] = {"winding_temperature_degc": findings.winding_degc, "longer_test": longer}
    said = list(remarks)
    if findings.link.is_reduced and findings.identity is not None:
        more["link"] = asdict(findings.link)
        said.insert(0, f"slow link: {findings.link.sentence(findings.identity.control_period_s)}")
    if longer is not None:
        said.append(longer.sentence)
    if match is not None:
        low, high = match.unseen_gain
        more["plate_match"] = {**asdict(match), "unseen_gain": [low, high]}
        said.append(
            f"a gain that all current sensors have in common would not have been noticed between {low:.2f} and {high:.2f}: it "
            "divides every resistance and inductance here; compare one current with a meter of your own"
        )
    return more | {"remarks": said}


def _before(findings: Findings, names: Mapping[str, str], factors: Mapping[str, float]) -> Mapping[str, float] | None:
    """The drive's values in use before the run, by the contract's names."""
    if findings.snapshot is None:
        return None
    held = findings.snapshot.in_use.items()
    by_field = {names[name]: value / factors.get(name, 1.0) for name, value in held if name in names}
    resistance, inductance = by_field.get(PARAMETERS[1]), by_field.get(PARAMETERS[3])
    if resistance and inductance:
        by_field["rotor_time_constant_s"] = inductance / resistance
    return by_field


def _written(findings: Findings, names: Mapping[str, str], factors: Mapping[str, float]) -> list[WrittenRow]:
    rows: list[WrittenRow] = []
    for row in findings.written:
        written: WrittenRow = {
            "name": row.name, "field": names.get(row.name), "register": row.register, "before": row.before,
            "after": row.after, "read_back": row.read_back,
        }  # fmt: skip
        if row.name in factors:
            written["per_si"] = factors[row.name]
        rows.append(written)
    return rows
