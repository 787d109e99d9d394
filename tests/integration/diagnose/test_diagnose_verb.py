"""`commissioner diagnose` and `simulate` as users call them: there and back, and data that carry no answer."""

import csv
import json

import numpy as np
import pytest

from commissioner.diagnose.plant.model import Model
from sim.recordings.hidden import draw
from sim.recordings.standstill import record, write_table
from tests.support.command_line import call, truth
from tests.support.service.described import judge
from tests.unit.diagnose.conftest import NOMINAL, setting_of
from tests.unit.diagnose.export.test_model_file import document_of

TYPE_TEST = "tests/data/siemens_200kw_type_test/{}.csv"


@pytest.fixture(scope="module")
def hidden():
    columns, metadata, _ = record(draw(5, "one", only="dead_time", noise="white", seconds=1.0), 5)
    del metadata["scenario"]
    return columns, metadata


@pytest.fixture(scope="module")
def files(hidden, tmp_path_factory):
    """Good and spoilt versions of one recording."""
    folder = tmp_path_factory.mktemp("recordings")
    columns, metadata = hidden

    def write(name, change=lambda c: c, **keys):
        write_table(folder / f"{name}.csv", change(dict(columns)), metadata | keys)

    write("good", lambda c: c | {"banana": c["time_s"]})
    write("short", lambda c: {k: v[:150] for k, v in c.items()})
    write("silent", lambda c: {k: 0.0 * v if k.startswith("current") else v for k, v in c.items()})
    write("one_sensor", lambda c: {k: v for k, v in c.items() if k not in ("current_v_a", "current_w_a")})
    write("another_motor", rated_power_w=55000.0)
    running = ("time_s", "current_u_a", "current_v_a", "current_w_a")
    write("running", lambda c: {k: c[k] for k in running} | {f"voltage_{p}_v": c["voltage_axis_v"] for p in "uvw"})
    (folder / "text.csv").write_text("hello\nworld\n")
    return folder


def table(path):
    with path.open() as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    return {k: np.array([float(r[k]) for r in rows]) for k in rows[0]}


def test_a_recording_is_diagnosed_and_its_model_plays_what_was_measured(files, tmp_path):
    answer = call("diagnose", str(files / "good.csv"), "--out", str(tmp_path), "--json")
    document = answer.json
    assert answer.code == 0
    judge("diagnose", document)
    judge("model", json.loads((tmp_path / "model.json").read_text("utf-8")))
    assert [c["name"] for c in document["causes"]] == ["dead_time"]
    assert document["verdict"] == "not_distinguishable" and document["causes"][0]["equivalent"] == ["device_drop"]
    assert any("banana" in sentence for sentence in document["audit"])
    page = (tmp_path / "report.html").read_text()
    assert "dead time + device drop, together" in page and "http" not in page.split("</style>")[1].replace(
        "http://www.w3.org", ""
    )
    again = tmp_path / "again.csv"
    assert (
        call("simulate", document["model_file"], "--out", str(again), "--like", str(files / "good.csv"), "--json").code
        == 0
    )
    measured, played = table(files / "good.csv"), table(again)
    error = np.sqrt(np.mean([(measured[f"current_{p}_a"] - played[f"current_{p}_a"]) ** 2 for p in "uvw"]))
    assert error == pytest.approx(document["gain"]["noise_floor_a"], rel=0.05)
    assert error < 0.5 * document["gain"]["rmse_before_a"]
    key = truth(document["model_file"])
    assert [e["name"] for e in key["effects"]] == ["dead_time"]


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["short"], "long enough"), (["silent"], "zero"), (["one_sensor"], "current_v_a"), (["running"], "record a start"),
        (["text"], "time_s"), (["good", "another_motor"], "rated_power_w"),
    ],
)  # fmt: skip
def test_data_that_carry_no_answer_end_with_code_3_and_the_reason(files, names, said):
    answer = call("diagnose", *(str(files / f"{name}.csv") for name in names), "--json")
    assert answer.code == 3
    assert said in answer.stdout + answer.stderr
    error = json.loads(answer.stdout)["error"]
    assert all(error[fact] not in (None, "") for fact in ("what", "step", "value", "limit", "remedy")), error


def test_both_tables_of_a_type_test_are_one_document(tmp_path):
    answer = call(
        "diagnose", TYPE_TEST.format("locked_rotor"), TYPE_TEST.format("no_load"), "--out", str(tmp_path), "--json"
    )
    named = {c["name"] for c in answer.json["causes"]}
    assert answer.code == 0
    assert named == {"leakage_saturation", "rotor_skin_effect", "magnetizing_saturation", "iron_loss"}
    assert sorted(p.name for p in tmp_path.glob("*.html")) == ["report_locked_rotor.html", "report_no_load.html"]
    assert json.loads((tmp_path / "diagnosis.json").read_text())["verdict"] == "explained"


def test_a_table_that_is_refused_has_a_page_and_the_remedy(tmp_path):
    rows = (tmp_path / "few.csv", "frequency_hz,voltage_line_v,current_line_a,power_w\n" + "50,100,10,500\n" * 9)
    rows[0].write_text(rows[1])
    answer = call("diagnose", str(rows[0]), "--out", str(tmp_path / "out"), "--json")
    assert answer.code == 3 and answer.json["verdict"] == "refused"
    assert (
        answer.json["error"]["value"] == 1
        and "at least 5" in answer.json["error"]["limit"]
        and answer.json["error"]["remedy"]
    )
    assert "cannot carry an answer" in (tmp_path / "out" / "report_few.html").read_text()
    assert "expected: at least 5; step: diagnose." in " ".join(call("diagnose", str(rows[0])).stdout.split())


def test_a_cell_that_is_no_number_and_a_column_that_lacks_are_named(tmp_path):
    table = tmp_path / "points.csv"
    table.write_text("frequency_hz,voltage_line_v,current_line_a,power_w\n50,100,10,500\n50,x,20,2000\n")
    assert "x in row 2" in call("diagnose", str(table)).stderr
    table.write_text("frequency_hz,voltage_line_v,current_line_a\n50,100,10\n50,200,20\n")
    assert "needs the column power_w" in call("diagnose", str(table)).stdout


def broken(document, where):
    term = document["terms"][0]
    return {
        "index": document | {"terms": [term | {"index": 999}]},
        "list": [document],
        "number": document | {"nominal": document["nominal"] | {"rotor_resistance_ohm": -1.0}},
        "else": {"kind": "something"},
    }[where]


@pytest.mark.parametrize("where", ["index", "list", "number", "else"])
def test_a_file_that_is_no_model_is_refused_as_configuration(tmp_path, where):
    document = document_of("dead_time", setting_of(Model(NOMINAL)))
    (tmp_path / "model.json").write_text(json.dumps(broken(document, where)))
    answer = call("simulate", str(tmp_path / "model.json"), "--seconds", "0.5", "--out", str(tmp_path / "out.csv"))
    assert answer.code == 2, answer.stderr
    assert "model.json" in "".join(answer.stderr.split()) and not (tmp_path / "out.csv").exists()


@pytest.mark.parametrize("verb", ["diagnose", "identify"])
def test_an_excerpt_under_another_name_is_no_second_measurement(files, tmp_path, verb):
    lines = (files / "good.csv").read_text("utf-8").splitlines(keepends=True)
    (tmp_path / "excerpt.csv").write_text("".join(lines[: len(lines) * 2 // 3]), encoding="utf-8")
    answer = call(verb, str(files / "good.csv"), str(tmp_path / "excerpt.csv"), "--json")
    assert answer.code == 3
    assert "the same measured samples" in answer.json["error"]["what"]
