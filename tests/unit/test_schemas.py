"""The shipped JSON schemas are those of the types, hold every promised key, and real documents keep to them."""

import json
from pathlib import Path

import pytest

from commissioner.docs import read_schema, schema_names
from commissioner.motor.circuit import PARAMETERS
from commissioner.schemas import SCHEMAS, text_of
from tests.support.archive.synthetic import MACHINE, make_run, result_of
from tests.support.service.described import judge
from tests.unit.cli.test_failures import leave
from tests.unit.recordings.test_catalogue_sheets import GERMAN
from tests.unit.recordings.test_test_sheets import SHEETS

DATA = Path(__file__).parents[1] / "data"
CONFIG = Path(__file__).parents[2] / "config"
T_MODEL = (
    "stator_resistance_ohm",
    "rotor_resistance_ohm",
    "stator_leakage_h",
    "rotor_leakage_h",
    "magnetizing_inductance_h",
    "assumption",
)
IDENTIFIED = (
    "outcome", "reason", *(f"parameters.{name}.{part}" for name in (*PARAMETERS, "rotor_time_constant_s") for part in ("value", "std")),
    *(f"t_model.{name}" for name in T_MODEL), "axes.axis_deg", "axes.parameters", "axes.whiteness", "axes.peak_rotor_flux_wb",
    "rated_flux_wb", "flux_guard.peak_fraction", "flux_guard.acted", "inverter", "gaps", "duration_s", "written",
)  # fmt: skip
PROMISED = {
    ("Command line: a failure", "failure"): ("reason", "error.step", "error.value", "error.limit", "error.remedy"),
    ("Results: identify", "identify"): IDENTIFIED,
    ("Results: run", "run"): (*IDENTIFIED, *(f"written.{key}" for key in ("name", "register", "before", "after", "read_back"))),
    ("Results: diagnose", "diagnose"): (
        "verdict", *(f"causes.{key}" for key in ("name", "parameters", "gain_share", "confidence", "equivalent")),
        *(f"gain.{key}" for key in ("held_out", "rmse_before_a", "rmse_after_a", "noise_floor_a")), "parameters_before",
        "parameters_after", "next_experiment", "model_file",
    ),
    ("Results: monitor", "monitor"): (
        "mean_speed_rad_per_s", "mean_torque_nm", "parameters", "periods", "current_resimulation_error", "indicators",
        "refused_because",
    ),
    ("Results: tune", "tune"): (*IDENTIFIED[:2], "tune.repeats", "tune.rows", "tune.best", "tune.in_the_drive"),
    ("Campaigns: --json", "study"): ("cases", "outcomes", "per_minute", "table", "report"),
    ("Campaigns: a row", "study_row"): (
        "case", "seed", "motor", "outcome", "reason", *(f"{name}_{part}" for name in PARAMETERS for part in ("true", "value", "std")),
        "peak_flux_fraction", "cpu_s",
    ),
}  # fmt: skip
"""Section of the contract, and document: keys that it may be relied on to have."""


def shapes(node, whole):
    """Objects that may stand at a place of a schema, or in a list there."""
    if "$ref" in node:
        yield from shapes(whole["$defs"][node["$ref"].rpartition("/")[2]], whole)
    elif "anyOf" in node:
        for one in node["anyOf"]:
            yield from shapes(one, whole)
    elif "items" in node:
        yield from shapes(node["items"], whole)
    else:
        yield node


def has(whole, path):
    nodes = [whole]
    for key in path.split("."):
        every = [shape.get("properties", {}) for node in nodes for shape in shapes(node, whole)]
        nodes = [properties[key] for properties in every if key in properties]
    return bool(nodes)


def test_a_schema_ships_of_every_document():
    assert set(schema_names()) == set(SCHEMAS)


@pytest.mark.parametrize("name", SCHEMAS)
def test_what_ships_is_what_the_types_say(name):
    assert read_schema(name) == text_of(name), "run python -m commissioner.schemas"


@pytest.mark.parametrize("promise", PROMISED, ids=lambda promise: promise[0])
def test_every_promised_key_is_in_its_schema(promise):
    whole = json.loads(read_schema(promise[1]))
    assert [key for key in PROMISED[promise] if not has(whole, key)] == []


def test_what_is_not_described_is_seen():
    with pytest.raises(AssertionError, match="outcome"):
        judge("failure", {"reason": "", "error": {}})


@pytest.mark.parametrize("text", [SHEETS["contract"], GERMAN], ids=["three tests", "catalogue"])
def test_sheets_and_their_model(tmp_path, capsys, text):
    path, out = tmp_path / "sheet.csv", tmp_path / "out"
    path.write_text(text, encoding="utf-8")
    for verb in ("identify", "diagnose"):
        code, document = leave(capsys, verb, str(path), "--out", str(out))
        assert code == 0
        judge(verb, document)
    if (out / "model.json").is_file():
        judge("model", json.loads((out / "model.json").read_text("utf-8")))


def test_tables_of_points(capsys):
    code, document = leave(
        capsys,
        "diagnose",
        *(str(DATA / "siemens_200kw_type_test" / f"{name}.csv") for name in ("no_load", "locked_rotor")),
    )
    assert code == 0
    judge("diagnose", document)


def test_drive_files_recordings_and_failures(tmp_path, capsys):
    judge("drives_list", leave(capsys, "drives", "list")[1])
    judge("drives_show", leave(capsys, "drives", "show", "simulated")[1])
    judge("drives_validate", leave(capsys, "drives", "validate", str(CONFIG / "drives" / "abb_acs380.toml"))[1])
    judge("failure", leave(capsys, "drives", "show", "nobody's")[1])
    path = tmp_path / "played.csv"
    judge("simulate", leave(capsys, "simulate", "motor_2kw2", "--out", str(path), "--seconds", "0.5")[1])
    judge(
        "recordings_import",
        leave(capsys, "recordings", "import", str(path), "--out", str(tmp_path / "again.parquet"))[1],
    )


def test_the_archive(tmp_path, capsys):
    runs, name = tmp_path / "runs", "20260101-000000-simulated-a"
    make_run(runs, name, result=result_of(name, MACHINE))
    for verb in ("list", "show", "verify"):
        code, document = leave(capsys, "runs", verb, *((name,) if verb != "list" else ()), "--runs", str(runs))
        assert code in (0, 3)
        judge(f"runs_{verb}", document, may_have_more=verb != "show")


def test_motors_over_the_years_and_what_is_moved(tmp_path, capsys):
    runs, share = tmp_path / "runs", tmp_path / "share"
    names = [f"2026{month:02d}01-000000-simulated-a" for month in (1, 3, 5)]
    for name in names:
        make_run(
            runs, name, result=result_of(name, MACHINE), origin={"motor_tag": "PUMP-3"} if name != names[2] else None
        )
    for document, arguments in (
        ("runs_index", ("runs", "index")),
        ("runs_motors", ("runs", "motors")),
        ("runs_motors", ("runs", "motors", names[2])),
        ("runs_motors", ("runs", "motors", names[2], "--tag", "PUMP-3")),
        ("runs_trend", ("runs", "trend", "PUMP-3")),
        ("runs_table", ("runs", "find", "simulated", "--out", str(tmp_path / "table.csv"))),
        ("runs_compare", ("runs", "compare", names[0], names[1])),
        ("runs_verify", ("runs", "verify", "--all")),
        ("runs_moved", ("runs", "push", str(share))),
    ):
        code, answer = leave(capsys, *arguments, "--runs", str(runs))
        assert code in (0, 3), answer
        assert "error" not in answer, answer
        judge(document, answer)
    judge("runs_moved", leave(capsys, "runs", "pull", str(share), "--runs", str(tmp_path / "other"))[1])


def test_adapters_and_accounts(tmp_path, capsys):
    judge("ports", leave(capsys, "ports")[1])
    secret = tmp_path / "secret"
    secret.write_text("correct horse battery\n", encoding="utf-8")
    runs = ("--runs", str(tmp_path / "runs"))
    leave(capsys, "accounts", "add", "anna", "--role", "operator", "--password-file", str(secret), *runs)
    code, known = leave(capsys, "accounts", "list", *runs)
    assert code == 0 and known["accounts"]
    judge("accounts", known)


def test_a_study_of_a_recording_that_cannot_be_read(tmp_path, capsys):
    (tmp_path / "one.csv").write_text("time_s,current_u_a\n0,1\n", encoding="utf-8")
    (tmp_path / "study.toml").write_text('kind = "identify"\nfiles = "*.csv"\n', encoding="utf-8")
    code, told = leave(capsys, "study", str(tmp_path / "study.toml"), "--out", str(tmp_path / "out"), "--workers", "1")
    assert (code, told["cases"]) == (0, 1), told
    judge("study", told)
