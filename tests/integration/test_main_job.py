"""The main job over a real wire against the simulated inverter in its own process, judged by its answer key and state log."""

import itertools
import json
import stat

import pytest

from commissioner.recordings.table import read_table, to_standstill
from tests.campaigns.combinations import CASES, run_case
from tests.support.command_line import at_flux, call, truth
from tests.support.service.described import judge
from tests.support.sim_process import SimProcess


def commission(url, runs, *arguments):
    """`commissioner run` for the 2.2-kW motor on the drive at the URL, without asking."""
    return call("run", "--drive", url, "--motor", "motor_2kw2", "--yes", "--json", "--runs", str(runs), *arguments)


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    """One whole commissioning over TCP with write-back; many tests look at it."""
    runs = tmp_path_factory.mktemp("archive") / "runs"
    with SimProcess("--scenario", "default", "--tcp", "0", "--seed", "1") as sim:
        answer = commission(sim.url, runs, "--write-back")
        restored = call("restore", "last", "--drive", sim.url, "--runs", str(runs), "--yes", "--json")
        checked = call("check", "--drive", sim.url, "--motor", "motor_2kw2", "--json")
        log = sim.log()
    return {
        "answer": answer,
        "log": log,
        "runs": runs,
        "restored": restored,
        "checked": checked,
        "key": truth("default"),
    }


@pytest.mark.parametrize(("name", "said"), [("run", "answer"), ("restore", "restored"), ("check", "checked")])
def test_what_is_printed_is_as_its_schema_says(job, name, said):
    judge(name, job[said].json)


def test_a_good_run_exits_with_zero_and_says_commissioned(job):
    assert job["answer"].code == 0
    assert job["answer"].json["outcome"] == "commissioned"


def test_every_parameter_is_within_three_per_cent_of_the_answer_key_at_the_flux_it_names(job):
    result = job["answer"].json
    key = at_flux(job["key"], result["holds_for_stator_flux_wb"])
    for name, true in key.items():
        found = result["parameters"][name]
        assert found["value"] == pytest.approx(true, rel=0.03), name
        assert 0 < found["std"] < 0.02 * found["value"], name


def test_three_axes_and_a_repeat_agree_and_each_has_a_whiteness_verdict(job):
    axes = job["answer"].json["axes"]
    assert [axis["axis_deg"] for axis in axes] == [0.0, 60.0, 120.0, 0.0]
    for axis in axes:
        assert axis["whiteness"]["statistic"] > 0
        assert axis["peak_rotor_flux_wb"] < axis["peak_stator_flux_wb"]


def test_the_inverters_lost_voltage_is_identified(job):
    inverter = job["key"]["inverter"]
    leg = job["answer"].json["inverter"]["leg_error_v"]["value"]
    plateau = inverter["leg_error_plateau_v"] if "leg_error_plateau_v" in inverter else 2.5e-6 * 5000 * 540 + 1.2
    assert leg == pytest.approx(plateau, rel=0.08)


def test_the_true_flux_never_passed_its_limit(job):
    limit = job["answer"].json["flux_guard"]["limit_wb"]
    true_peak = max(row["stator_flux_wb"] for row in job["log"] if row["event"] == "peaks")
    assert 0.6 * limit < true_peak <= 1.02 * limit


def test_the_watchdog_was_armed_before_the_first_enable_and_never_relaxed(job):
    armed_s, enabled = [], False
    for row in job["log"]:
        if row["event"] == "write" and row["item"] == "watchdog_ms":
            armed_s.append(row["value"])
            assert not enabled
        if row["event"] == "energised":
            enabled = True
            assert armed_s, "energised without a watchdog"
            assert 0 < armed_s[-1] <= 1000
    assert enabled


def test_the_drive_ends_de_energised(job):
    states = [row["event"] for row in job["log"] if row["event"] in ("energised", "de_energised")]
    assert states[-1] == "de_energised"
    assert states == ["energised", "de_energised"] * (len(states) // 2)


def test_what_was_written_was_read_back_and_restore_brings_the_old_values_back(job):
    written = {row["name"]: row for row in job["answer"].json["written"]}
    assert len(written) == 4
    for row in written.values():
        assert row["read_back"] == pytest.approx(row["after"], rel=1e-6)
    assert job["restored"].code == 0
    back = {row["name"]: row["read_back"] for row in job["restored"].json["written"]}
    for name, row in written.items():
        assert back[name] == pytest.approx(row["before"], rel=1e-6)
    assert job["checked"].json["parameters_in_drive"] == pytest.approx(
        {n: r["before"] for n, r in written.items()}, rel=1e-6
    )


def test_each_axis_was_energised_for_twelve_seconds_at_most(job):
    sessions = [row for row in job["log"] if row["event"] in ("energised", "de_energised")]
    pairs = itertools.pairwise(sessions)
    lasted = [(on["axis_deg"], off["t"] - on["t"]) for on, off in pairs if on["event"] == "energised"]
    axes = [sum(s for _, s in rows) for _, rows in itertools.groupby(lasted, key=lambda row: row[0])]
    assert len(axes) == 4
    assert max(axes) <= 12.0


def test_the_run_folder_holds_every_sample_every_decision_and_one_self_contained_report(job):
    (folder,) = job["runs"].iterdir()
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    recording = to_standstill(read_table(folder / "recording.parquet"))
    assert recording.time_s.size * recording.sample_period_s == pytest.approx(
        job["answer"].json["energised_s"], abs=0.05
    )
    kinds = {json.loads(line)["kind"] for line in (folder / "journal.jsonl").read_text().splitlines()}
    assert {
        "about_to",
        "checks_judged",
        "staircase_fitted",
        "estimate_updated",
        "verdict_reached",
        "run_ended",
    } <= kinds
    page = (folder / "report.html").read_text()
    assert page.count("<svg") >= 4
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert "https://" not in page.replace("https://www.w3.org", "")
    assert "<script" not in page


def test_identify_offline_gives_the_runs_answer_from_its_samples(job):
    (folder,) = job["runs"].iterdir()
    offline = call("identify", str(folder / "recording.parquet"), "--motor", "motor_2kw2", "--json")
    assert offline.code == 0
    judge("identify", offline.json)
    for name, quantity in job["answer"].json["parameters"].items():
        assert offline.json["parameters"][name]["value"] == pytest.approx(quantity["value"], rel=1e-6)


def test_replay_makes_the_same_decisions_bit_for_bit(job):
    answer = call("replay", "last", "--runs", str(job["runs"]), "--json")
    assert answer.code == 0, answer.stdout[:2000]
    judge("replay", answer.json)
    assert answer.json["identical"] is True
    assert answer.json["decisions"] > 100


def test_report_and_samples_of_an_archived_run_are_found(job, tmp_path):
    for name, arguments in (
        ("runs_report", ("report", "last")),
        ("runs_export", ("export", "last", str(tmp_path / "out.csv"))),
    ):
        answer = call("runs", *arguments, "--runs", str(job["runs"]), "--json")
        assert answer.code == 0, answer.stdout[:2000]
        judge(name, answer.json)


def test_the_archive_lists_and_shows_the_run(job):
    listed = call("runs", "list", "--runs", str(job["runs"]), "--json").json["runs"]
    assert [run["outcome"] for run in listed] == ["commissioned"]
    assert "SIM-INV-7A" in listed[0]["drive"]
    shown = call("runs", "show", "last", "--runs", str(job["runs"]))
    assert shown.code == 0
    assert "commissioned" in shown.stdout


# --- over a serial line ----------------------------------------------------------------------------------------------


def test_the_whole_job_runs_over_rtu(tmp_path):
    with SimProcess("--scenario", "default", "--rtu", "pty", "--seed", "2") as sim:
        answer = commission(sim.url, tmp_path, "--axes", "0", "--write-back")
    assert answer.code == 0, answer.stdout
    result = answer.json
    for name, true in at_flux(truth("default"), result["holds_for_stator_flux_wb"]).items():
        assert result["parameters"][name]["value"] == pytest.approx(true, rel=0.03), name
    assert len(result["written"]) == 4


# --- what must not be energised ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scenario", "code", "says"),
    [
        ("sto_open", 3, "safe torque off"),
        ("fault_present", 3, "no fault"),
        ("watchdog_refused", 3, "watchdog"),
        ("wrong_identity", 5, "magic"),
        ("wrong_firmware", 5, "firmware"),
    ],
)
def test_a_drive_that_is_not_fit_is_refused_with_its_reason_and_never_energised(scenario, code, says, tmp_path):
    with SimProcess("--scenario", scenario, "--tcp", "0") as sim:
        seen = call("check", "--drive", sim.url, "--json")
        answer = commission(sim.url, tmp_path)
        log = sim.log()
    assert answer.code == code
    document = answer.json
    assert says in document["reason"] + str(document["error"]["step"])
    assert document["error"]["remedy"]
    assert document["error"]["limit"] is not None
    if scenario != "watchdog_refused":  # `check` arms none
        assert seen.code == code and seen.json["error"]["limit"] == document["error"]["limit"]
    assert not any(row["event"] == "energised" for row in log)
    (folder,) = tmp_path.iterdir()
    assert (folder / "report.html").is_file()


def test_no_drive_at_the_url_is_a_fault_with_a_remedy(tmp_path):
    answer = commission("tcp://127.0.0.1:1", tmp_path)
    assert answer.code == 5
    assert answer.json["outcome"] == "faulted"
    assert "cable" in answer.json["error"]["remedy"]


def test_without_yes_and_without_a_person_nothing_is_energised(tmp_path):
    with SimProcess("--scenario", "default", "--tcp", "0") as sim:
        answer = call("run", "--drive", sim.url, "--motor", "motor_2kw2", "--json", "--runs", str(tmp_path))
        assert not any(row["event"] == "energised" for row in sim.log())
    assert answer.code == 2


# --- other motors ------------------------------------------------------------------------------------------------


def test_a_motor_that_would_pass_the_flux_limit_is_held_back_in_truth(tmp_path):
    with SimProcess("--scenario", "flux_hazard", "--tcp", "0", "--seed", "3") as sim:
        answer = commission(sim.url, tmp_path, "--axes", "0")
        peak = max(row["stator_flux_wb"] for row in sim.log() if row["event"] == "peaks")
    limit = answer.json["flux_guard"]["limit_wb"]
    assert answer.code in (0, 3, 4)
    assert peak <= 1.02 * limit


@pytest.mark.parametrize("name", ["0k18_small_inverter", "15k_hard"])
def test_another_motor_behind_another_inverter_is_commissioned_as_well(name, tmp_path, is_short):
    """A short version, by day along one axis, of `python -m tests.campaigns.combinations`, which has 18."""
    case = next(case for case in CASES if case.name == name)
    outcome = run_case(case, tmp_path, arguments=("--axes", "0") if is_short else ())
    assert outcome.ended == "commissioned", outcome.reason
    for parameter, percent in outcome.errors_percent.items():
        assert abs(percent) < 3.0, parameter
    assert 0.6 < outcome.peak <= 1.02
