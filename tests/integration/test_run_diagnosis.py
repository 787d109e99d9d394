"""A run ends with a diagnosis of its own samples: the inverter's loss is named, and what it would have done to R_s."""

import pytest

from commissioner.diagnose.diagnosis import diagnose
from commissioner.diagnose.document import as_document
from commissioner.recordings.table import read_table, to_standstill
from commissioner.report.run.summary import diagnosis_sentences
from tests.support.command_line import call
from tests.support.sim_process import SimProcess


@pytest.fixture(scope="module")
def ended(tmp_path_factory):
    runs = tmp_path_factory.mktemp("archive")
    with SimProcess("--scenario", "default", "--tcp", "0", "--seed", "1") as sim:
        answer = call(
            "run", "--drive", sim.url, "--motor", "motor_2kw2", "--axes", "0", "--yes", "--json", "--diagnosis",
            "--runs", str(runs),
        )  # fmt: skip
    return answer, runs


def test_the_loss_of_the_legs_is_named_in_the_result(ended):
    answer, _ = ended
    causes = {c["name"]: c for c in answer.json["diagnosis"]["causes"]}
    assert "device_drop" in causes["dead_time"]["equivalent"]


def test_the_result_says_what_a_plain_fit_would_have_made_of_the_resistance(ended):
    answer, _ = ended
    moved = {m["parameter"]: m for m in answer.json["diagnosis"]["moved"]}["stator_resistance_ohm"]
    assert moved["cause"] == "dead_time"
    assert moved["four_parameters"] > 1.2 * answer.json["parameters"]["stator_resistance_ohm"]["value"]
    assert moved["with_causes"] == pytest.approx(answer.json["parameters"]["stator_resistance_ohm"]["value"], rel=0.1)


def test_the_whole_diagnosis_and_the_sentence_are_in_the_run_folder(ended):
    answer, runs = ended
    (folder,) = (path.parent for path in runs.glob("*/diagnosis.json"))
    assert any("would have come out" in remark for remark in answer.json["remarks"])
    assert "would have come out" in (folder / "report.html").read_text()


def test_a_diagnosis_whose_time_is_over_does_not_say_that_nothing_fits(ended):
    answer, runs = ended
    (path,) = runs.glob("*/recording.parquet")
    document = as_document(diagnose([to_standstill(read_table(path))], go_on=lambda: False), None)
    assert not document["is_complete"]
    assert document["reason"].startswith("Not finished")
    assert (
        "stopped before every cause was tried"
        in diagnosis_sentences(document | {"moved": []}, answer.json["parameters"])[0]
    )
