"""Motor parameters in the drive: staged, committed into use, stored for good; each step takes its time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sim.drive.drive_map import DriveMap
from sim.drive.live import crc16
from sim.drive.memory import Memory
from sim.drive.states import Setup
from sim.wire.state_log import StateLog

PARAMETERS = ("stator_resistance", "rotor_resistance", "leakage_inductance", "magnetizing_inductance")
PARAMETER_RANGE = ((1e-3, 1e3), (1e-3, 1e3), (1e-3, 1e3), (1e-2, 1e4))  # wire units: ohm, ohm, mH, mH
COMMIT_S, STORE_S = 0.015, 0.060
BUSY, DONE, WRONG_CHECK_SUM, OUT_OF_RANGE = 1, 2, 3, 4
FAILED = 3


class ParameterSet:
    """`in_use` are the committed values in wire units; `values` is the drive's register file with the staged ones."""

    def __init__(
        self, values: dict[str, Any], drive_map: DriveMap, setup: Setup, memory: Memory, log: StateLog
    ) -> None:
        self.values, self.map, self.setup, self.memory, self.log = values, drive_map, setup, memory, log
        self.in_use = [float(v) for v in memory.content["parameters"]]
        for name, value in zip(PARAMETERS, self.in_use, strict=True):
            values["staged_" + name] = value
        self.commit_result = self.store_result = 0
        self.commit_due = self.store_due = math.inf

    def begin(self, command: str, t: float) -> None:
        """Start a commit or a store; the result is busy until its time has passed."""
        if command == "commit":
            self.commit_result, self.commit_due = BUSY, math.inf if self.setup.commit_sticks else t + COMMIT_S
        else:
            self.store_result, self.store_due = BUSY, t + STORE_S

    def finish_due(self, t: float) -> int:
        """End what is due at motor time `t`; how many of the two sets, in use and stored, it changed."""
        before = [*self.in_use], [*self.memory.content["parameters"]]
        if t >= self.commit_due:
            self.commit_due = math.inf
            self._finish_commit(t)
        if t >= self.store_due:
            self.store_due = math.inf
            self._finish_store(t)
        return (before[0] != self.in_use) + (before[1] != self.memory.content["parameters"])

    def _finish_commit(self, t: float) -> None:
        self.values["commit"] = 0
        staged = [float(self.values["staged_" + name]) for name in PARAMETERS]
        self.commit_result = self._judge(staged)
        if self.commit_result == DONE and "commit" not in self.setup.ignores:
            self.in_use = staged
        self.log.write("commit", t, result=self.commit_result, in_use=self.in_use)

    def _judge(self, staged: list[float]) -> int:
        items = [self.map.items["staged_" + name] for name in PARAMETERS]
        words = [w for item, v in zip(items, staged, strict=True) for w in item.encode(v)]
        if crc16(np.array(words)) != self.values["staged_crc"]:
            return WRONG_CHECK_SUM
        fits = all(lo <= v <= hi for v, (lo, hi) in zip(staged, PARAMETER_RANGE, strict=True))
        return DONE if fits else OUT_OF_RANGE

    def _finish_store(self, t: float) -> None:
        self.values["store"] = 0
        self.store_result = FAILED if self.setup.store_fails else DONE
        if self.setup.store_fails:
            self.memory.wear()
        elif "store" not in self.setup.ignores:
            self.memory.store(list(self.in_use))
        content = self.memory.content
        self.log.write(
            "store", t, result=self.store_result, stored=content["parameters"], store_count=content["store_count"]
        )
