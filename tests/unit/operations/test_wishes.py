"""What an option asks for and cannot be is a refusal with its range, before any file is read."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from commissioner.errors import DataRefused, UsageError
from commissioner.operations.archive import verify_runs
from commissioner.operations.recordings.diagnose import DiagnoseRequest, diagnose
from commissioner.operations.recordings.identify import IdentifyRequest, identify_any
from commissioner.operations.recordings.intake import require_independent
from commissioner.operations.recordings.monitor import MonitorRequest, monitor
from commissioner.operations.recordings.simulate import SimulateRequest, simulate
from commissioner.recordings.table import Table

NOWHERE = Path("nowhere.csv")


@pytest.mark.parametrize("inertia", [math.nan, -1.0, 0.0, 1e9])
def test_an_inertia_that_no_machine_has_is_refused(inertia: float) -> None:
    with pytest.raises(UsageError, match="--inertia") as refused:
        monitor(MonitorRequest(NOWHERE, inertia_kg_m2=inertia))
    assert refused.value.limit == "1e-07 ... 1e+06"


def test_learning_without_a_baseline_is_refused() -> None:
    with pytest.raises(UsageError, match="--learn has no baseline"):
        monitor(MonitorRequest(NOWHERE, learn=True))


@pytest.mark.parametrize(("verb", "wish"), [(identify_any, IdentifyRequest), (diagnose, DiagnoseRequest)])
def test_the_same_file_does_not_count_twice(tmp_path: Path, verb, wish) -> None:
    with pytest.raises(UsageError, match="is given twice"):
        verb(wish((tmp_path / "a.csv", tmp_path / "b" / ".." / "a.csv")))


def _taken(seed: int, first: int = 0, last: int = 3000) -> Table:
    rng = np.random.default_rng(seed)
    columns = {f"current_{k}_a": rng.normal(size=3000).round(1)[first:last] for k in "uvw"}
    return Table(columns, {}, f"{seed}-{first}.csv")


def test_a_copy_or_an_excerpt_under_another_name_is_no_second_measurement() -> None:
    require_independent([_taken(1), _taken(2)])
    for again in (_taken(1), _taken(1, 700, 1400)):
        with pytest.raises(DataRefused, match="the same measured samples") as refused:
            require_independent([_taken(1), _taken(2), again])
        assert refused.value.exit_code == 3


def test_a_seed_below_zero_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--seed -4"):
        simulate(SimulateRequest("motor_2kw2", tmp_path / "y.csv", None, 6.0, (0.0,), 0.0, -4, False))


def test_an_archive_that_is_not_there_is_no_sound_one(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="is no folder"):
        verify_runs(tmp_path / "nirgends", None)


def test_a_run_without_its_journal_is_damaged_and_not_passed_over(tmp_path: Path) -> None:
    folder = tmp_path / "20260101T000000-motor"
    folder.mkdir()
    (folder / "request.json").write_text("{}", encoding="utf-8")
    (verified,) = verify_runs(tmp_path, None)
    assert not verified.is_whole
    assert any("journal.jsonl" in str(loss) for loss in verified.losses)


def test_a_played_recording_without_noise_is_said_to_hold_none_and_is_known_by_it(tmp_path: Path) -> None:
    quiet, noisy = tmp_path / "quiet.csv", tmp_path / "noisy.csv"
    assert any("--noise-a" in remark for remark in simulate(SimulateRequest("motor_2kw2", quiet, seconds=2.0)).remarks)
    assert simulate(SimulateRequest("motor_2kw2", noisy, seconds=2.0, noise_a=1e-3)).remarks == ()
    said = {}
    for path in (quiet, noisy):
        done = identify_any(IdentifyRequest((path,), motor="motor_2kw2"))
        said[path] = done.document["remarks"]  # type: ignore[union-attr]
    assert any("is not white" in remark for remark in said[quiet])
    assert any("hold no noise" in remark for remark in said[quiet])
    assert not any("hold no noise" in remark for remark in said[noisy])


def test_a_runs_result_is_no_model_and_the_remedy_says_what_is(tmp_path):
    result = tmp_path / "result.json"
    result.write_text('{"kind": "commissioning result", "parameters": {}}', encoding="utf-8")
    with pytest.raises(UsageError, match="holds no model") as caught:
        simulate(SimulateRequest(str(result), tmp_path / "played.csv"))
    assert "model.json of a diagnosis" in caught.value.remedy
