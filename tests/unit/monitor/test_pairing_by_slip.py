"""At light load two orders of the channels make a motor; the slip tells them apart, and no standard deviation is unknown."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from commissioner.monitor.intake.findings import Finding
from commissioner.monitor.loads.pairing_by_slip import better_order
from commissioner.monitor.machine.fit import PRIOR_FROM_NAMEPLATE, Start
from commissioner.monitor.periods.steadiness import too_little
from commissioner.monitor.result import as_document
from commissioner.motor.nameplate import Nameplate
from commissioner.motor.running import from_nameplate
from commissioner.records import RunningRecording
from tests.support.running import refused_in, rewired, seen_in, taken_with

LIGHT: dict[str, Any] = {
    "steady_load": {"constant_nm": 0.3, "per_speed_nms": 0.0},
    "loads": [{"kind": "compressor", "mean_nm": 0.8, "leak_mm2": [0.0, 0.0], "pressure_ratio": 4.0}],
}


def lightly_loaded() -> tuple[RunningRecording, Nameplate]:
    recording, plate, _ = taken_with("running_compressor", 1, 8.0, LIGHT)
    return recording, plate


@pytest.mark.parametrize(
    ("order", "sign"),
    [((1, 0, 2, 3, 4, 5), 1), ((0, 1, 2, 5, 4, 3), 1), ((2, 0, 1, 3, 4, 5), -1)],
)
def test_the_torque_is_the_same_whatever_the_order(order: tuple[int, ...], sign: int) -> None:
    recording, plate = lightly_loaded()
    right = seen_in(recording, plate)
    seen = seen_in(rewired(recording, order, (sign,) * 3 + (1,) * 3), plate)
    assert right.audited.rivals_deg
    assert seen.mean_torque_nm == pytest.approx(right.mean_torque_nm, abs=right.mean_torque_std)


def test_named_columns_that_the_slip_contradicts_are_refused() -> None:
    recording, plate = lightly_loaded()
    reason = refused_in(rewired(recording, (1, 2, 0, 3, 4, 5), (-1, -1, -1, 1, 1, 1)), plate).reason
    assert reason.code == "pairing"
    assert "slip contradicts" in reason.what


def test_a_corrected_order_that_the_slip_contradicts_is_exchanged() -> None:
    recording, plate = lightly_loaded()
    seen = seen_in(recording, plate)
    turn = np.exp(1j * np.radians(60.0))
    crossed = Finding("crossed_channels", "corrected", "")
    audited = replace(seen.audited, findings=(crossed,), lag_deg=seen.audited.lag_deg - 60.0, rivals_deg=(82.5,))
    frame = replace(seen.frame, current_a=seen.frame.current_a * turn)
    start = Start(from_nameplate(plate), PRIOR_FROM_NAMEPLATE, "nameplate")
    wrong = replace(seen.search, slip=0.3 * seen.search.slip + 0.05, slip_std=0.015)
    assert better_order(audited, frame, seen.part, plate, start, wrong, seen.found) == 82.5


def test_a_shaft_line_without_a_known_frequency_is_refused() -> None:
    recording, plate = lightly_loaded()
    seen = seen_in(recording, plate)
    assert seen.found.shaft is not None
    loose = replace(seen.found, shaft=replace(seen.found.shaft, frequency_std_hz=float("inf")))
    reason = too_little(seen.frame, seen.part, loose, seen.search)
    assert reason is not None and reason.code == "no_shaft_line"


def test_every_standard_deviation_is_a_number() -> None:
    recording, plate = lightly_loaded()

    def stds(node: object) -> list[float]:
        if not isinstance(node, dict):
            return [s for one in node for s in stds(one)] if isinstance(node, list) else []
        own = [value for key, value in node.items() if "std" in key and not isinstance(value, dict | str)]
        return own + [s for value in node.values() for s in stds(value)]

    found = stds(as_document(seen_in(recording, plate), None, [], None))
    assert len(found) > 10
    assert all(s is not None and np.isfinite(s) for s in found)
