"""What a recorded DC link says of causes that modulate it."""

from __future__ import annotations

import numpy as np

from commissioner.diagnose.causes.cause import Cause
from commissioner.diagnose.intake.record import Record
from commissioner.diagnose.plant.model import Model
from commissioner.diagnose.plant.prediction import modulation

LEAST_SEEN, CLEARLY = 0.3, 6.0
"""Of a sag or a ripple, what a recorded link must show of it, and how many standard errors of white noise it may miss."""
COLUMN = "Record the DC-link voltage too (column dc_link_v)."


class OfTheLink(Cause):
    """Modulates the voltage with the link's own course."""

    where_recorded: str
    """What settles the name where the link was recorded with the currents."""

    def what_decides(self, record: Record) -> str:
        return self.where_recorded if all(s.link_swing is not None for s in record.segments) else self.decides

    def is_ruled_out(self, model: Model, record: Record) -> bool:
        """Whether the link was recorded and surely moves by less than LEAST_SEEN of what this cause says."""
        if not model.of(self.name):
            return False
        share, standard_error = self._shown_by_the_link(model, record)
        return share + CLEARLY * standard_error < LEAST_SEEN

    def is_shown(self, model: Model, record: Record) -> bool:
        """Whether the link was recorded and surely moves by more than LEAST_SEEN of what this cause says."""
        share, standard_error = self._shown_by_the_link(model, record)
        return share - CLEARLY * standard_error > LEAST_SEEN

    def _shown_by_the_link(self, model: Model, record: Record) -> tuple[float, float]:
        """Share of what this cause says of the link that the recorded one shows, and its standard error; anything where it was not recorded."""
        both = power = swung = 0.0
        count = 0
        for segment, channels in zip(record.segments, record.channels, strict=True):
            if segment.link_swing is None:
                return LEAST_SEEN, np.inf
            course = modulation(model.only((self.name,)), segment, channels)[0]
            said, seen = course - course.mean(), segment.link_swing - segment.link_swing.mean()
            both, power, swung = both + float(said @ seen), power + float(said @ said), swung + float(seen @ seen)
            count += segment.count
        if power == 0.0:
            return LEAST_SEEN, np.inf
        share = both / power
        return share, float(np.sqrt(max(swung - share * both, 0.0) / count / power))
