"""A serial line that cannot carry every sample: the procedure plans itself, and what it finds is true within its errors.

In motor time: the simulator lets as much time pass as the bytes take at that rate.
"""

import numpy as np
import pytest

from commissioner.identify.analysis import identify
from commissioner.recordings.table import read_table, to_standstill
from commissioner.run.archive.replay import replay
from sim.wire.pace import Pace
from tests.support.paced import commissioned


@pytest.fixture(scope="module")
def at_115200(tmp_path_factory):
    return commissioned(tmp_path_factory.mktemp("runs"), Pace(115200, 0.001))


def test_a_full_three_axis_run_at_115200_ends_commissioned(at_115200):
    run = at_115200
    assert run.ended.outcome == "commissioned", run.ended
    assert run.findings.written
    assert len(run.findings.identification.axes) == 4
    assert run.findings.link.averaged > 1 and len(run.findings.link.channels) == 3
    assert run.overruns == 0 and run.findings.identification.lost_samples == 0


def test_what_is_found_at_115200_is_true_within_three_of_its_errors(at_115200):
    assert np.max(np.abs(at_115200.errors_in_std)) < 3.0
    found = at_115200.findings.identification
    assert np.max(np.array(found.std) / found.parameters.as_tuple()) < 0.01


def test_the_flux_stays_under_its_limit_at_115200_in_truth(at_115200):
    assert at_115200.station.highest_flux_wb < at_115200.findings.flux_limit_wb


def test_the_recording_of_means_gives_the_runs_answer_offline(at_115200):
    recording = to_standstill(read_table(at_115200.folder / "recording.parquet"))
    offline = identify(recording, winding_temperature_degc=at_115200.findings.winding_degc)
    found = at_115200.findings.identification
    assert offline.parameters.as_tuple() == pytest.approx(found.parameters.as_tuple(), rel=1e-6)


def test_a_run_of_means_is_decided_again_bit_for_bit(at_115200):
    assert replay(at_115200.folder).is_identical


def test_a_run_at_19200_captures_downloads_and_is_true_within_three_of_its_errors(tmp_path):
    run = commissioned(tmp_path, Pace(19200, 0.005))
    assert run.ended.outcome == "commissioned", run.ended
    assert run.findings.link.captured > 0
    assert run.overruns == 0 and run.findings.identification.lost_samples == 0
    assert np.max(np.abs(run.errors_in_std)) < 3.0
    assert run.station.highest_flux_wb < run.findings.flux_limit_wb


def test_150_ms_a_request_are_refused_before_anything_is_energised(tmp_path):
    run = commissioned(tmp_path, Pace(10_000_000, 0.150))
    assert run.ended.outcome == "rejected" and run.ended.energised_s == 0.0
    assert "the link keeps up with the samples" in run.ended.reason
