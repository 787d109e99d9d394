"""The archive as one table: what a spreadsheet or a query reads is what the folders say; the manual's query runs."""

import csv
import json
import re
from importlib import resources

import duckdb
import pytest
from typer.testing import CliRunner

from commissioner.cli.app import app
from commissioner.errors import UsageError
from commissioner.run.archive.catalogue import read_runs
from tests.support.archive.synthetic import make_archive


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    made = tmp_path_factory.mktemp("archive") / "runs"
    make_archive(made, 30)
    return made


def called(root, *arguments):
    answer = CliRunner().invoke(app, ["runs", *arguments, "--runs", str(root), "--json"])
    return answer.exit_code, answer.stdout, answer.exception


def test_every_run_is_a_row_with_its_values_and_errors(root, tmp_path):
    table = tmp_path / "runs.csv"
    code, stdout, _ = called(root, "list", "--out", str(table))
    assert code == 0 and json.loads(stdout) == {"table": str(table), "runs": 30}
    rows = {row["run"]: row for row in csv.DictReader(table.read_text("utf-8").splitlines())}
    for run in read_runs(root, with_results=False):
        row = rows[run.run]
        assert (row["outcome"], row["motor_tag"], row["drive_serial"]) == (
            run.outcome,
            run.motor_tag,
            str(run.serial_number),
        )
        assert float(row["rated_power_w"]) == run.motor["rated_power_w"]
        for name, quantity in run.parameters.items():
            assert float(row[name]) == pytest.approx(quantity["value"], rel=1e-8)
            assert float(row[f"{name}_std"]) == pytest.approx(quantity["std"], rel=1e-8)


def test_only_what_is_asked_for(root, tmp_path):
    some = read_runs(root, with_results=False)[3]
    code, stdout, _ = called(root, "find", some.motor_tag, "--out", str(tmp_path / "some.parquet"))
    assert code == 0
    wanted = [run for run in read_runs(root, with_results=False) if run.motor_tag == some.motor_tag]
    assert json.loads(stdout)["runs"] == len(wanted)


def test_the_manuals_query_runs_on_the_table(root, tmp_path, monkeypatch):
    called(root, "list", "--out", str(tmp_path / "runs.parquet"))
    manual = resources.files("commissioner.docs").joinpath("archive.md").read_text("utf-8")
    (query,) = re.findall(r"```sql\n(.*?)```", manual, re.S)
    monkeypatch.chdir(tmp_path)
    seen = {row[0]: row[1:] for row in duckdb.sql(query).fetchall()}
    good = [run for run in read_runs(root, with_results=False) if run.outcome == "commissioned"]
    assert set(seen) == {run.motor_tag for run in good}
    for tag, (runs, r_s, l_m) in seen.items():
        own = [run for run in good if run.motor_tag == tag]
        values = [run.parameters["stator_resistance_ohm"]["value"] for run in own]
        assert runs == len(own) and r_s == pytest.approx(sum(values) / len(values), rel=1e-6)
        assert l_m > 0


def test_another_ending_is_refused_by_name(root, tmp_path):
    _, _, problem = called(root, "list", "--out", str(tmp_path / "runs.xlsx"))
    assert isinstance(problem, UsageError) and problem.limit == ".csv or .parquet"
