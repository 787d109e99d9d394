"""A run is followed by a diagnosis of its own samples, which joins the archive: the inverter's loss is named, and what it would have
done to R_s."""

import json
import shutil
from pathlib import Path

import pytest

from commissioner.diagnose.diagnosis import diagnose
from commissioner.diagnose.document import as_document
from commissioner.operations.closing import await_diagnosis, begin_diagnosis, diagnose_archived
from commissioner.recordings.table import read_table, to_standstill
from commissioner.report.page import with_notice
from commissioner.report.run.summary import diagnosis_sentences
from commissioner.run.archive.verify import verify
from commissioner.run.stopping.operator_stop import OperatorStop
from tests.replay.golden import SEED, short_run
from tests.support.command_line import call
from tests.support.sim_process import SimProcess

LONGEST_S = 600.0
"""A whole diagnosis along one axis: 30 CPU-seconds, on a host that does three things at once much longer."""
INVERTER_ALONE = """
description = "no saturation, sensors of one gain that are read at once: the inverter alone loses voltage"
machine = { inductance_h = 0.245, saturation_at_rated_flux = 0.0 }
power_stage = { link_ripple = 0.0 }
sensors = { gain = [1.0, 1.0, 1.0], delay_s = 0.0, lag_s = 0.0 }
heating = { stator_per_min = 0.0, rotor_per_min = 0.0 }
drive = { control_period_s = 4e-4 }
"""
"""At half the samples, for half the time."""
pytestmark = pytest.mark.timeout(LONGEST_S)


@pytest.fixture(scope="module")
def undiagnosed(tmp_path_factory):
    scenario = tmp_path_factory.mktemp("scenario") / "inverter_alone.toml"
    scenario.write_text(INVERTER_ALONE, encoding="utf-8")
    with SimProcess("--scenario", str(scenario), "--tcp", "0", "--seed", SEED) as sim:
        return short_run(sim.url, tmp_path_factory.mktemp("runs"))


@pytest.fixture(scope="module")
def ended(undiagnosed, tmp_path_factory):
    folder = copy_of(undiagnosed, tmp_path_factory.mktemp("archive"))
    return call("runs", "diagnose", "last", "--runs", str(folder.parent), "--json", timeout_s=LONGEST_S), folder


@pytest.fixture
def run(undiagnosed, tmp_path):
    return copy_of(undiagnosed, tmp_path)


def copy_of(run, root):
    return Path(shutil.copytree(run, root / run.name))


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


def test_it_joins_the_archive_whose_chain_stays_whole(ended):
    answer, folder = ended
    assert any("would have come out" in remark for remark in answer.json["remarks"])
    assert json.loads((folder / "result.json").read_text("utf-8")) == answer.json
    assert "would have come out" in (folder / "report.html").read_text("utf-8")
    seen = verify(folder)
    assert (seen.state, seen.losses) == ("intact", ())
    assert json.loads((folder / "diagnosis.json").read_text("utf-8"))["verdict"] == answer.json["diagnosis"]["verdict"]


def test_a_diagnosis_whose_time_is_over_does_not_say_that_nothing_fits(ended):
    answer, folder = ended
    document = as_document(diagnose([to_standstill(read_table(folder / "recording.parquet"))], go_on=lambda: False))
    assert not document["is_complete"]
    assert document["reason"].startswith("Not finished")
    assert (
        "stopped before every cause was tried"
        in diagnosis_sentences(document | {"moved": []}, answer.json["parameters"])[0]
    )


def test_a_process_of_its_own_makes_it_and_a_later_one_takes_its_place(run):
    page, stop = run / "report.html", OperatorStop()
    page.write_text(with_notice(page.read_text("utf-8"), "Restored & <kept>"), encoding="utf-8")
    await_diagnosis(begin_diagnosis(run, 0.0, None), run, stop)
    first = json.loads((run / "result.json").read_text("utf-8"))
    assert diagnose_archived(run.parent, run.name, 0.0) == first
    assert first["diagnosis"]["is_complete"] is False
    assert sum("stopped before every cause was tried" in remark for remark in first["remarks"]) == 1
    assert page.read_text("utf-8").count("<p>Restored &amp; &lt;kept&gt;</p>") == 1
    assert verify(run).state == "intact"


def test_a_stop_ends_it_and_leaves_the_run_as_it_was(run):
    before, stop = (run / "result.json").read_bytes(), OperatorStop()
    stop.ask("otto", "STOP")
    process = begin_diagnosis(run, 100.0, None)
    await_diagnosis(process, run, stop)
    assert process.wait(10.0) != 0
    assert (run / "result.json").read_bytes() == before
    assert verify(run).state == "intact"


def test_a_run_that_identified_nothing_is_refused(run):
    result = json.loads((run / "result.json").read_text("utf-8")) | {"parameters": {}}
    (run / "result.json").write_text(json.dumps(result), encoding="utf-8")
    answer = call("runs", "diagnose", "last", "--runs", str(run.parent))
    assert answer.code == 3
    assert "identified nothing" in answer.stderr
