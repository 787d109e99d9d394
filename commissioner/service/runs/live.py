"""What a page shows of a run that goes on: one small document, the same for all who look."""

from __future__ import annotations

from dataclasses import asdict
from typing import cast

from commissioner.service.contract.live import LiveDocument, LiveTest, LiveTuning
from commissioner.service.runs.state import AxisTest, OwnTuning, RunState


def live_document(state: RunState, current_now_a: float) -> LiveDocument:
    """The newest numbers. `estimate`: time, four values, four standard errors of the running test, SI."""
    k = state.current
    return {
        "run": state.run,
        "phase": state.phase,
        "output": state.output,
        "part": state.part,
        "test": None if k is None else k + 1,
        "tests": [_test(test) for test in state.tests],
        "planned_s": state.planned_test_s,
        "left_s": round(state.left_s, 2),
        "current": {
            "now_a": round(current_now_a if state.output == "on" else 0.0, 3),
            "high_a": round(state.current_high_a, 3),
            "limit_a": state.current_limit_a,
        },
        "flux": {
            "now_wb": _rounded(state.flux_now_wb if state.output == "on" else 0.0),
            "high_wb": _rounded(state.flux_high_wb),
            "limit_wb": _rounded(state.flux_limit_wb),
        },
        "tuning": _tuning(state.tuning),
        "estimate": state.history[-1] if state.history else None,
        "utc": state.utc,
    }


def _tuning(tuning: OwnTuning | None) -> LiveTuning | None:
    if tuning is None:
        return None
    return {"done": len(tuning.done), "question": tuning.question["number"] if tuning.question else None}


def _test(test: AxisTest) -> LiveTest:
    return cast("LiveTest", asdict(test) | {"energised_s": round(test.energised_s, 2)})


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 5)
