"""An archived run decides again as it did: the golden one from the repository, and one made just now, bit for bit."""

import dataclasses
import json
import math
import pickle
import shutil
from contextlib import closing, nullcontext
from io import BytesIO
from types import SimpleNamespace

import numpy as np
import pytest

from commissioner.errors import DataRefused, WriteBackFailed
from commissioner.identify.analysis import identify
from commissioner.link.drive.facts import Action, Intent
from commissioner.operations.archive import report_run
from commissioner.procedure import steps
from commissioner.procedure.energised import excite
from commissioner.procedure.steps import Findings
from commissioner.report.run.standing import Held, Standing
from commissioner.run import write_accepted
from commissioner.run.archive import replay as replaying
from commissioner.run.archive.blocks import read_blocks
from commissioner.run.archive.folder import RunFolder
from commissioner.run.archive.journal import read_journal
from commissioner.run.archive.replay import learn_again, replay
from commissioner.run.archive.summary import summarise
from commissioner.run.archive.verify import verify
from commissioner.run.index.index import find
from commissioner.run.index.results import result_of
from commissioner.run.index.rows import Wanted
from tests.replay.golden import GOLDEN, SEED, short_run, unpack
from tests.support.archive.chained import rechain
from tests.support.sim_process import SimProcess

ROUNDING = 1e-6
"""Other processors add up in another order."""


@pytest.fixture
def golden(tmp_path):
    return unpack(GOLDEN, tmp_path)


@pytest.fixture(scope="module")
def fresh(tmp_path_factory):
    with SimProcess("--tcp", "0", "--seed", SEED) as sim:
        return short_run(sim.url, tmp_path_factory.mktemp("runs"))


@pytest.fixture(scope="module")
def fits():
    """What `identify` gave, by all it was given."""
    return {}


@pytest.fixture(autouse=True)
def each_samples_are_fitted_once(monkeypatch, fits):
    """`identify` is a pure function that takes five seconds; the run itself, made before, is fitted without this."""

    def fitted(*given, earlier=None, **options):  # without what only saves time
        key = pickle.dumps((given, options))
        if key not in fits:
            fits[key] = identify(*given, **options)
        return fits[key]

    for caller in (excite, steps):
        monkeypatch.setattr(caller, "identify", fitted)


def test_a_run_made_on_this_machine_is_decided_again_bit_for_bit(fresh):
    told = []
    replayed = replay(fresh, observe=told.append)
    assert replayed.difference is None
    assert replayed.decisions > 30
    numbers = [progress.number for progress in told]
    assert numbers == sorted(numbers) and 30 < numbers[-1] <= {progress.of for progress in told}.pop()


def test_the_golden_run_is_decided_again(golden):
    journal = read_journal(golden / "journal.jsonl")
    archived = [line for line in journal if line["kind"] in replaying._DECISIONS]
    replayed = list(replaying._decide_again(replaying.read_job(golden, journal), Findings(), journal, golden))
    assert [line["kind"] for line in archived] == [line["kind"] for line in replayed]
    for old, new in zip(archived, replayed, strict=True):
        assert_alike(old["record"], new["record"], old["kind"])


def assert_alike(old, new, where):
    """The same words and structure, the same numbers but for rounding."""
    if isinstance(old, dict):
        assert old.keys() == new.keys(), where
        for key in old:
            assert_alike(old[key], new[key], f"{where}.{key}")
    elif isinstance(old, list):
        assert len(old) == len(new), where
        for k, pair in enumerate(zip(old, new, strict=True)):
            assert_alike(*pair, f"{where}[{k}]")
    elif isinstance(old, float):
        assert math.isclose(old, new, rel_tol=ROUNDING, abs_tol=1e-9), (where, old, new)
    else:
        assert old == new, where


@pytest.mark.parametrize("at", [0.2, 0.6, 0.9])
def test_a_changed_sample_is_reported(fresh, tmp_path, at):
    folder = copy(fresh, tmp_path)
    blocks = list(read_blocks(folder / "blocks.bin"))
    place = int(at * len(blocks))
    segment, block = blocks[place]
    blocks[place] = (segment, dataclasses.replace(block, current_u_a=block.current_u_a + 0.5))
    (folder / "blocks.bin").unlink()
    archive = RunFolder(folder)
    for segment, block in blocks:
        archive.append(block, segment)
    archive.close()
    difference = replay(folder).difference
    assert difference is not None
    assert difference.archived != difference.replayed


@pytest.mark.parametrize("kind", ["checks_judged", "excitation_chosen", "estimate_updated", "verdict_reached"])
def test_a_changed_decision_is_reported_as_itself(fresh, tmp_path, kind):
    folder = copy(fresh, tmp_path)
    lines = (folder / "journal.jsonl").read_text().splitlines()
    decisions = [k for k, line in enumerate(lines) if replaying._is_compared(json.loads(line))]
    number = next(n for n, k in enumerate(decisions) if json.loads(lines[k])["kind"] == kind)
    changed = json.loads(lines[decisions[number]])
    key = next(iter(changed["record"]))
    changed["record"][key] = "changed"
    lines[decisions[number]] = json.dumps(changed)
    (folder / "journal.jsonl").write_text("\n".join(lines) + "\n")
    difference = replay(folder).difference
    assert difference is not None
    assert (difference.number, difference.archived["kind"]) == (number, kind)


def test_a_missing_block_is_reported(fresh, tmp_path):
    folder = copy(fresh, tmp_path)
    data = (folder / "blocks.bin").read_bytes()
    (folder / "blocks.bin").write_bytes(data[: len(data) // 2])
    difference = replay(folder).difference
    assert difference is not None
    assert difference.replayed is None or difference.archived != difference.replayed


def _plate(command, value):
    """Of one command's replies every value."""
    return lambda r: r.get("command") == command and r.update(reply=dict.fromkeys(r["reply"], value))


@pytest.mark.parametrize(
    ("kind", "forge", "seen"),
    [
        ("job", lambda job: job["nameplate"].update(rated_current_a="x"), "rated_current_a"),
        ("job", lambda job: job["nameplate"].update(rated_frequency_hz=0.0), "rated_frequency_hz"),
        ("job", lambda job: job["plan"].update(axes_deg=[]), "orientations_deg"),
        ("job", lambda job: job["plan"]["excitation"].update(seconds=1e300), "excitation.seconds"),
        ("job", lambda job: job.update(link_latency_s=None), "link_latency_s"),
        ("job", lambda job: job.update(pace={"round_trip_s": 0.0, "samples": 0, "registers": 0}), "ZeroDivisionError"),
        ("reply", _plate("ReadStatus", "x"), "AttributeError"),
        ("reply", _plate("ReadNameplate", "x"), "TypeError"),
    ],
)
def test_what_no_run_was_asked_or_answered_is_damage_and_no_defect(golden, kind, forge, seen):
    """The chain is right: somebody has computed it anew."""

    def change(line):
        if line["kind"] == kind:
            forge(line["record"])
        return line

    rechain(golden / "journal.jsonl", change)
    with pytest.raises(DataRefused, match=r"journal\.jsonl is damaged") as refusal:
        learn_again(golden)
    assert seen in str(refusal.value.value)


def test_a_folder_without_a_job_is_refused(tmp_path):
    (tmp_path / "journal.jsonl").write_text("")
    with pytest.raises(DataRefused, match="cannot be replayed"):
        replay(tmp_path)


def copy(run, target):
    folder = target / "copy"
    folder.mkdir()
    for name in ("journal.jsonl", "blocks.bin", "request.json", "result.json"):
        (folder / name).write_bytes((run / name).read_bytes())
    return folder


def test_the_golden_run_is_a_whole_one(golden):
    kinds = [line["kind"] for line in read_journal(golden / "journal.jsonl")]
    assert kinds[-1] == "folder_closed"
    samples = np.concatenate([block.current_u_a for _, block in read_blocks(golden / "blocks.bin")])
    assert samples.size > 40_000
    assert np.all(np.isfinite(samples))


def edit(folder, change):
    """The journal with its records changed by `change`, which may drop some."""
    path = folder / "journal.jsonl"
    kept = [change(json.loads(line)) for line in path.read_text().splitlines()]
    path.write_text("".join(json.dumps(line) + "\n" for line in kept if line is not None))
    return folder


class Sent(Exception):
    """A drive was opened."""


@pytest.mark.parametrize("forged", [{}, {"value": 3.1}])
def test_a_result_that_its_samples_do_not_lead_to_is_not_written(fresh, tmp_path, monkeypatch, forged):
    """The chain is right: somebody has closed the folder anew over another value, which the plate allows."""
    folder = tmp_path / fresh.name
    shutil.copytree(fresh, folder)
    result = json.loads((folder / "result.json").read_text())
    result["parameters"]["stator_resistance_ohm"] |= forged
    with closing(RunFolder(folder)) as archive:
        archive.journal("snapshot_restored", {})
        archive.save("result.json", result)

    def opened(*_, **__):
        raise Sent

    monkeypatch.setattr(write_accepted, "open_port", opened)
    with pytest.raises(DataRefused if forged else Sent) as refusal:
        write_accepted.write_accepted(summarise(folder), None, "token")
    if forged:
        assert refusal.value.what.endswith("in record.parameters.stator_resistance_ohm.value")
        assert refusal.value.limit == 3.1


@pytest.mark.parametrize(("was_restored", "held"), [(True, Held.RESTORED), (False, Held.OLD_OR_NEW)])
def test_a_write_that_failed_and_was_taken_back_leaves_nobody_in_doubt(
    fresh, tmp_path, monkeypatch, was_restored, held
):
    """It stood as `old or new` until somebody restored what the drive held already."""
    folder = tmp_path / fresh.name
    shutil.copytree(fresh, folder)
    with closing(RunFolder(folder)) as archive:
        archive.journal("snapshot_restored", {})

    class Failing:
        def __init__(self, _port, _profile, announce):
            self.announce = announce

        def identify(self):
            return SimpleNamespace(words="a drive")

        def write_circuit(self, *_):
            self.announce(Intent(Action.COMMIT, {}))
            failed = WriteBackFailed("x", step="x", value=1, limit=2, remedy="x")
            failed.was_restored = was_restored
            raise failed

    stubs = {
        "open_port": lambda *_, **__: BytesIO(),
        "Inverter": Failing,
        "_plan": lambda *_: None,
        "check_token": lambda *_: None,
    }
    for name, stub in {**stubs, "Mastery": lambda *_: nullcontext(SimpleNamespace(take=lambda _: None))}.items():
        monkeypatch.setattr(write_accepted, name, stub)
    with pytest.raises(WriteBackFailed):
        write_accepted.write_accepted(summarise(folder), None, "token")
    assert summarise(folder).held is held


def test_a_result_whose_samples_are_lost_is_not_written(fresh, tmp_path, monkeypatch):
    folder = tmp_path / fresh.name
    shutil.copytree(fresh, folder)
    with closing(RunFolder(folder)) as archive:
        archive.journal("snapshot_restored", {})
    (folder / "blocks.bin").unlink()
    monkeypatch.setattr(write_accepted, "open_port", None)
    with pytest.raises(DataRefused, match=r"blocks\.bin is not as the run left it"):
        write_accepted.write_accepted(summarise(folder), None, "token")


def test_a_changed_end_is_reported(fresh, tmp_path):
    def change(line):
        if line["kind"] == "run_ended":
            line["record"]["outcome"] = "rejected"
        return line

    difference = replay(edit(copy(fresh, tmp_path), change)).difference
    assert difference is not None and difference.archived["kind"] == "run_ended"


@pytest.mark.parametrize(
    ("action", "key"), [("prepare", "watchdog_ms"), ("energise", "tones"), ("steer", "amplitude_scale")]
)
def test_a_command_that_was_carried_out_otherwise_is_reported(fresh, tmp_path, action, key):
    was_changed = []

    def change(line):
        values = line["record"].get("values", {}) if line["kind"] == "about_to" else {}
        if not was_changed and key in values and line["record"]["action"] == action:
            was_changed.append(values[key])
            values[key] = [99.0, *values[key][1:]] if isinstance(values[key], list) else values[key] + 0.25
        return line

    difference = replay(edit(copy(fresh, tmp_path), change)).difference
    assert was_changed and difference.archived["kind"] == "about_to"
    assert difference.archived["record"]["values"][key] != difference.replayed["record"]["values"][key]


def test_a_changed_result_is_reported(fresh, tmp_path):
    path = copy(fresh, tmp_path) / "result.json"
    document = json.loads(path.read_text())
    document["flux_guard"]["peak_fraction"] += 0.01
    path.write_text(json.dumps(document))
    assert replay(path.parent).difference.archived["kind"] == "result"


def test_a_run_killed_before_its_result_says_so_and_is_made_whole_from_its_samples(fresh, tmp_path):
    """Every list had it as `commissioned`, and nobody its values."""
    folder, before = tmp_path / fresh.name, json.loads((fresh / "result.json").read_text())
    shutil.copytree(
        fresh, folder, ignore=shutil.ignore_patterns("result.json", "report.html", "summary.json", "*.parquet")
    )
    lines = (folder / "journal.jsonl").read_text().splitlines(keepends=True)
    end = next(number for number, line in enumerate(lines) if json.loads(line)["kind"] == "run_ended")
    (folder / "journal.jsonl").write_text("".join(lines[: end + 1]))
    row = json.loads(find(tmp_path, Wanted()).rows[0].document)
    assert (row["outcome"], row["standing"], row["lacks_result"]) == ("commissioned", Standing.NOT_KEPT, True)
    assert find(tmp_path, Wanted(outcome=Standing.NOT_KEPT)).total == 1 and "runs report" in row["reason"]
    for use in (result_of, lambda run: write_accepted.write_accepted(run, None, "")):
        with pytest.raises(DataRefused, match="has no result") as refused:
            use(summarise(folder))
        assert f"runs report {folder.name}" in refused.value.remedy
    assert report_run(tmp_path, folder.name).losses == ()
    assert json.loads((folder / "result.json").read_text()) == before
    made = summarise(folder)
    assert made.standing is Standing.COMMISSIONED and not made.lacks_result and made.reason == before["reason"]
    assert verify(folder).losses == () and (folder / "recording.parquet").is_file() and result_of(made)
    assert str(report_run(tmp_path, folder.name).report) == str(folder / "report.html")


def test_what_a_diagnosis_added_to_the_result_is_no_difference():
    formed = {"run": "a", "remarks": ("one",), "diagnosis": None, "energised_s": 3.0}
    saved = {"run": "b", "remarks": ["one", "more"], "diagnosis": {}, "energised_s": 3.0}
    assert replaying._result(saved, formed) == replaying._result(formed, formed)
    assert replaying._result(saved | {"energised_s": 4.0}, formed) != replaying._result(formed, formed)


def test_a_record_taken_out_is_refused(fresh, tmp_path):
    folder = edit(copy(fresh, tmp_path), lambda line: None if line["kind"] == "verdict_reached" else line)
    with pytest.raises(DataRefused, match="journal") as caught:
        replay(folder)
    assert "belongs" in caught.value.value


def test_a_bad_line_before_the_last_is_refused_and_a_torn_last_one_is_not(fresh, tmp_path):
    path = copy(fresh, tmp_path) / "journal.jsonl"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines) + '{"n": 9')
    assert replay(path.parent).is_identical
    lines[5] = "garbage\n"
    path.write_text("".join(lines))
    with pytest.raises(DataRefused, match="journal") as caught:
        replay(path.parent)
    assert "line 6" in caught.value.value


def test_a_journal_without_a_decision_is_refused(fresh, tmp_path):
    path = copy(fresh, tmp_path) / "journal.jsonl"
    lines = path.read_text().splitlines(keepends=True)
    job = next(k for k, line in enumerate(lines) if json.loads(line)["kind"] == "job")
    kept = [line for line in lines[: job + 1] if json.loads(line)["kind"] not in replaying._DECISIONS]
    path.write_text("".join(json.dumps(json.loads(line) | {"n": k}) + "\n" for k, line in enumerate(kept)))
    with pytest.raises(DataRefused, match="journal"):
        replay(path.parent)
