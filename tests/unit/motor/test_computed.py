"""Which of three currents was computed: each pair stands as u and v of a frame turned to it, and the fewest causes decide."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from commissioner.motor.computed import COMPUTED, other_pairs, without_computed_third
from commissioner.operations.recordings import diagnose as operation
from commissioner.records import StandstillRecording


def recording() -> StandstillRecording:
    """A pulsating current along 20 and 75 degrees."""
    t = np.arange(400) / 4000.0
    axis = np.where(t < 0.05, 20.0, 75.0)
    u, v, w = (3.0 * np.sin(2 * np.pi * 40 * t + 0.3) * np.cos(np.radians(axis - 120 * k)) for k in range(3))
    u, v = np.round(u, 4), np.round(v, 4)
    del w
    return StandstillRecording(
        t, np.zeros(t.size, np.int64), axis, 50 * u, u, v, -(u + v), None, 2.5e-4, {}, "made", ()
    )


def test_each_pair_is_the_same_current_in_its_own_frame() -> None:
    one = without_computed_third(recording())
    assert one.current_w_a is None and [n.code for n in one.notes] == [COMPUTED]
    size = 3.0 * np.sin(2 * np.pi * 40 * one.time_s + 0.3)
    for name, other in other_pairs(one):
        assert name in ("u", "v")
        for k, x in enumerate((other.current_u_a, other.current_v_a)):
            np.testing.assert_allclose(x, size * np.cos(np.radians(other.axis_deg - 120 * k)), atol=3e-4)


@pytest.mark.parametrize(("counts", "wanted"), [([3, 3, 1], "v"), ([3, 1, 1], "u"), ([3, 3, 3], None)])
def test_the_pair_that_explains_by_the_fewest_causes_is_taken(monkeypatch, counts, wanted) -> None:
    made = [SimpleNamespace(verdict="explained", causes=[0] * n) for n in counts]
    later = iter(made[1:])
    monkeypatch.setattr(operation, "analyse", lambda *_, **__: next(later))
    one = without_computed_third(recording())
    best, said, phases = operation._of_another_pair([one], made[0], (), lambda _: None, lambda: True)
    assert best is (made[0] if wanted is None else made[{"u": 1, "v": 2}[wanted]])
    assert (f"current {wanted} is the computed one" in said[0]) if wanted else said == []
    assert phases == {"u": "vwu", "v": "wuv", None: "uvw"}[wanted]


@pytest.mark.parametrize(
    ("phases", "key", "named"),
    [
        ("uvw", "gain_v_over_u", "gain_v_over_u"), ("vwu", "gain_v_over_u", "gain_w_over_v"),
        ("wuv", "gain_v_over_u", "gain_u_over_w"), ("vwu", "offset_u_a", "offset_v_a"),
        ("wuv", "offset_v_at_start_a", "offset_u_at_start_a"), ("vwu", "time_constant_us", "time_constant_us"),
    ],
)  # fmt: skip
def test_sizes_are_named_by_the_phases_of_the_recording(phases: str, key: str, named: str) -> None:
    assert operation._named_by(phases, key) == named
