"""Mains hum in the current channels."""

from __future__ import annotations

import numpy as np

from commissioner.diagnose.causes.cause import FINE, Cause, Confounder, Entry, Form, Words
from commissioner.diagnose.causes.mains_lines import line_entry
from commissioner.diagnose.causes.setting import PHASES, Numbers, Setting, Sizes
from commissioner.diagnose.kernels.kinds import TONE
from commissioner.diagnose.plant.model import Model, Term


class MainsPickup(Cause):
    """Cosine and sine amplitude [A] per channel at the refined mains frequency."""

    name = "mains_pickup"
    place = 24
    title = "Mains hum in the current channels"
    family = "non-periodic"
    sign = 0
    form = Form.EXACT
    line = "mains"
    signature = "a line at 50 or 60 Hz that does not depend on the excitation"
    source = "a cos wt + b sin wt per channel, frequency refined on the data"
    confounders = (Confounder("dc_link_ripple"),)
    split_by = "record one second with the inverter off"
    decides = "Record one second with the inverter off: hum stays."
    words = Words(
        "Mains hum is in the current channels ({size})",
        FINE,
        measurement="Lay the sensor cables away from mains and motor cables; ground their shield.",
    )

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        record = setting.record
        names = [n for n in record.channel_names if n.startswith("mains_")]
        at = {n: 3 * record.channel(n) for n in names}
        return tuple(
            Term(self.name, f"{n}_{PHASES[k]}_{s.uid}", "A", TONE, at[n] + k, 1e-3, segment=s.uid, channel=n)
            for s in record.segments
            for n in names
            for k in range(record.facts.phases)
        )

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        out: dict[str, tuple[float, str]] = {}
        for base in (50, 60):
            parts = np.array([v for k, v in values.items() if k.startswith(f"mains_{base}_")])
            if parts.size:
                out[f"amplitude_{base}_hz_a"] = (float(np.sqrt(2.0 * np.mean(parts**2))), "A")
        return out

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        return line_entry(self.line, sizes, setting.lines_hz)


CAUSE = MainsPickup()
