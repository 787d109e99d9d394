"""Time stamps as files hold them: rounded to a few decimals, seconds since 1970, of a clock that is not quite the period's."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.diagnose.intake.audit import prepare
from commissioner.errors import DataRefused
from commissioner.monitor.intake.clock import _is_printed_line
from commissioner.recordings.table import Table, sample_period
from tests.unit.diagnose.conftest import recording


def period_of(time_s, **metadata):
    return sample_period(Table({"time_s": time_s}, metadata, "file"), np.zeros(time_s.size))


@pytest.mark.parametrize(
    ("rate_hz", "decimals", "begin_s"), [(6000.0, 6, 0.0), (8000.0, 5, 0.0), (5000.0, 6, 1.79e9), (3000.0, 5, 7.3)]
)
def test_the_period_is_not_bent_by_rounded_stamps(rate_hz, decimals, begin_s):
    stamps = np.round(begin_s + np.arange(30_000) / rate_hz, decimals)
    assert period_of(stamps) == pytest.approx(1.0 / rate_hz, rel=1e-5)
    assert period_of(np.delete(stamps, [700, 701, 9000])) == pytest.approx(1.0 / rate_hz, rel=1e-5)


def test_stamps_of_six_significant_digits_are_rounded_ones():
    stamps = np.array([float(f"{t:.6g}") for t in np.arange(20_000) / 8000.0])
    assert period_of(stamps) == pytest.approx(1.25e-4, rel=1e-5)
    assert period_of(stamps, sample_period_s=1.25e-4) == 1.25e-4
    assert _is_printed_line(stamps)


@pytest.mark.parametrize("share", [0.05, 0.3])
def test_stamps_that_wander_are_refused(share):
    random = np.random.default_rng(1)
    with pytest.raises(DataRefused, match="not equal"):
        period_of((np.arange(5000) + share * random.uniform(-1.0, 1.0, 5000)) * 2e-4)


@pytest.mark.parametrize("stamped", [lambda t: np.round(0.625 * t, 5), lambda t: 1.79e9 + t, lambda t: 1.0005 * t])
def test_segments_lie_on_the_grid_of_the_period_and_nothing_is_lost(stamped):
    source = recording(seconds=4.0)
    time_s = stamped(source.time_s)
    period = period_of(time_s[source.segment == 0]) if stamped(1.0) < 1.0 else source.sample_period_s
    record, audit = prepare([replace(source, time_s=time_s, sample_period_s=period)])
    assert not audit.holes and [s.count for s in record.segments] == [20_000] * 3
    for segment in record.segments:
        assert segment.is_good.all() and segment.period_s == pytest.approx(period, rel=1e-6)
