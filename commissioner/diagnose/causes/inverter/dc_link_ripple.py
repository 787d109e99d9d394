"""Ripple of the DC link."""

from __future__ import annotations

import numpy as np

from commissioner.diagnose.causes.cause import NO_FAULT, Entry, Form, Words
from commissioner.diagnose.causes.inverter.link import COLUMN, OfTheLink
from commissioner.diagnose.causes.mains_lines import line_entry
from commissioner.diagnose.causes.setting import Numbers, Setting, Sizes
from commissioner.diagnose.kernels.kinds import VOLTAGE_MOD
from commissioner.diagnose.plant.model import Model, Term


class DcLinkRipple(OfTheLink):
    """Relative amplitudes a, b of the rectifier's ripple line (frequency refined on the data)."""

    name = "dc_link_ripple"
    place = 3
    title = "Ripple of the DC link"
    family = "non-periodic"
    sign = 0
    form = Form.EXACT
    meets_tones = True
    line = "ripple"
    signature = "side lines at every tone plus and minus 100, 120, 300 or 360 Hz, proportional to the tone"
    source = "v = v* (1 + a cos wt + b sin wt); rectifier ripple, N. Mohan, Power Electronics, ch. 5"
    split_by = "record the DC-link voltage"
    decides = "Record the DC-link voltage with the currents (column dc_link_v)."
    where_recorded = "Look at the recorded dc_link_v: the ripple must be in it."
    words = Words(
        "Ripple of the DC link ({size}) reaches the motor",
        f"{NO_FAULT} Its torque can hum at the ripple's frequency.",
        "If the ripple is new, check the three mains phases and the link's capacitors.",
        COLUMN,
    )

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        record = setting.record
        names = [n for n in record.channel_names if n.startswith("ripple_")]
        return tuple(
            Term(self.name, f"{n}_{s.uid}", "1", VOLTAGE_MOD, record.channel(n), 0.01, segment=s.uid, channel=n)
            for s in record.segments
            for n in names
        )

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        sizes: dict[str, tuple[float, str]] = {}
        for base in (100, 120, 300, 360):
            parts = [v for k, v in values.items() if k.startswith(f"ripple_{base}_")]
            if parts:
                sizes[f"amplitude_{base}_hz"] = (float(np.sqrt(2.0 * np.mean(np.square(parts)))), "1")
        return sizes

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        return line_entry(self.line, sizes, setting.lines_hz)


CAUSE = DcLinkRipple()
