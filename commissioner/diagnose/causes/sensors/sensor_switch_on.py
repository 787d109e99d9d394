"""Current sensors that are still settling when the recording begins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from commissioner.diagnose.causes.cause import FINE, Cause, Confounder, Entry, Form, Words
from commissioner.diagnose.causes.setting import PHASES, Array, Numbers, Setting, Sizes
from commissioner.diagnose.intake.record import Record
from commissioner.diagnose.kernels.kinds import TONE
from commissioner.diagnose.plant.model import Model, Term

SETTLE_S = {"switch_on_10ms": 0.01, "switch_on_30ms": 0.03, "switch_on_100ms": 0.1}
"""Time constants of the dictionary: in sums of these each one between 8 and 120 ms is there to 1 % of its power."""


class SensorSwitchOn(Cause):
    """Reported current is i + sum a_k exp(-t / T_k), a [A] per phase, t from the first sample of a file, T of 10, 30 and 100 ms."""

    name = "sensor_switch_on"
    place = 27
    title = "Current sensors that are still settling"
    family = "dc"
    sign = 0
    form = Form.EXACT
    signature = "an offset at the start of the recording that is gone within a second, whatever the command"
    source = "start-up time of a sensor's supply and reference, in its data sheet"
    confounders = (Confounder("sensor_offset"), Confounder("sensor_drift"), Confounder("remanence"))
    split_by = "switch the sensors on a minute before the test"
    decides = (
        "Record one second with the inverter off, right after the sensors are switched on and again a minute later."
    )
    words = Words(
        "The current sensors were still settling when the recording began (off zero by up to {size})",
        FINE,
        measurement="Switch the sensors on a minute before the test.",
    )

    def regressors(self, record: Record) -> Mapping[str, Sequence[Array]]:
        begins = {s.file: s.time_s[0] for s in reversed(record.segments)}
        since = [s.time_s - begins[s.file] for s in record.segments]
        return {name: [np.exp(-t / settle_s) for t in since] for name, settle_s in SETTLE_S.items()}

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        at = {n: 3 * setting.record.channel(n) for n in SETTLE_S}
        return tuple(
            Term(self.name, f"{n}_{PHASES[k]}", "A", TONE, at[n] + k, 1e-3, channel=n)
            for n in SETTLE_S
            for k in range(setting.facts.phases)
        )

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        """Off zero at the first sample."""
        found = {p: sum(values.get(f"{n}_{p}", 0.0) for n in SETTLE_S) for p in PHASES}
        return {f"offset_{p}_at_start_a": (found[p], "A") for p in PHASES[: setting.facts.phases]}

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        """One time constant: of all that is off zero, weighed by how much of it settles with each."""
        per_phase = np.array([sizes.get(f"offset_{p}_at_start_a", 0.0) for p in PHASES])
        area = sum(abs(values.get(f"{n}_{p}", 0.0)) * t for n, t in SETTLE_S.items() for p in PHASES)
        whole = sum(abs(values.get(f"{n}_{p}", 0.0)) for n in SETTLE_S for p in PHASES)
        largest = float(np.abs(per_phase).max()) or 1.0
        weights = {f"weight_{p}": float(x) / largest for p, x in zip(PHASES, per_phase, strict=True)}
        return {"size": largest, "time_s": area / max(whole, 1e-300), **weights}


CAUSE = SensorSwitchOn()
