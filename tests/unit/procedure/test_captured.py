"""A test whose samples the drive keeps: they must be there for the time that it took."""

from types import SimpleNamespace

import pytest

from commissioner.errors import DriveFault
from commissioner.procedure.energised.captured import _download
from commissioner.procedure.link_plan import LinkPlan

FINDINGS = SimpleNamespace(
    identity=SimpleNamespace(control_period_s=2e-4), link=LinkPlan(averaged=15, captured=5), peak_flux_fraction=0.0
)


def downloaded(samples):
    steps = _download(FINDINGS, "multitone test", 60.0, 5.0)
    next(steps)
    return steps.send(SimpleNamespace(samples_produced=samples))


def test_a_drive_whose_time_stood_still_during_the_test_is_said_so():
    """48 means of 1 ms of a test of 5 s: a simulated inverter that waits for its reader."""
    with pytest.raises(DriveFault) as seen:
        downloaded(48)
    assert seen.value.value == pytest.approx(0.048) and seen.value.limit == pytest.approx(2.5)
    assert "--speed 1" in seen.value.remedy and "axis 60 deg" in seen.value.step


def test_samples_of_the_whole_test_are_asked_for():
    assert type(downloaded(5000)).__name__ == "Fetch"
