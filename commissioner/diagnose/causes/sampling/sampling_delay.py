"""Delay between command and sampled current."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace

from commissioner.diagnose.causes.cause import FINE, Cause, Confounder, Entry, Form, Words
from commissioner.diagnose.causes.sampling.read_late import CONDUCTANCE, EARLY, shown_at_its_instant
from commissioner.diagnose.causes.setting import Numbers, Setting, Sizes
from commissioner.diagnose.kernels.kinds import DELAY
from commissioner.diagnose.plant.impedance import impedance_starts
from commissioner.diagnose.plant.model import Model, Term

LARGE_MISFIT, LARGE_DELAYS = 9.0, (0.7, 1.5, 2.5)
"""Of the noise's power, and in sample periods: such delays turn the phases so far that no first-order promise shows them."""
LATE = "Nothing to repair: one or two sampling periods are usual. A delay that is known can be taken off the current's time."


class SamplingDelay(Cause):
    """Reported current is i(t - tau), tau >= 0 [s], and a part that is added and taken off from sample to sample; tau < 0 only in
    exchange for a conductance and a cable that imitate it.
    """

    name = "sampling_delay"
    place = 16
    title = "Delay between command and sampled current"
    family = "linear"
    sign = 1
    form = Form.EXACT
    makes_late = True
    is_common = True
    signature = "phase proportional to frequency at excited lines, no distortion"
    source = "computation and PWM delay: B.-H. Bae, S.-K. Sul, IEEE Trans. Ind. Appl. 39(3), 2003"
    confounders = (
        Confounder("cable_capacitance"),
        Confounder("rotor_skin_effect"),
        Confounder("iron_loss", least_share=5e-4),
    )
    split_by = "lines closer to half the sampling rate, or a loop-back test of the sensor"
    decides = "Add a tone near 0.4 of the sampling rate."
    exchanged = (EARLY,)
    words = Words("The current is recorded {size} after the voltage", FINE, measurement=LATE)
    read_late = Words(
        "The current is read {size} after the instant it is recorded for",
        FINE,
        measurement="Read the current at the step of the command, or correct its time stamps by that.",
    )
    advice = "Normal where it is a part of a sample period."

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        return (
            Term(self.name, "delay", "s", DELAY, 0, 1e-6, 0.0, 0.02),
            Term(self.name, "alternating", "s", DELAY, 1, 1e-6, -0.02, 0.02),
        )

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        delay = values.get("delay", 0.0) + values.get(EARLY.symbol, 0.0)
        return {"delay_us": (delay * 1e6, "us"), "alternating_us": (abs(values.get("alternating", 0.0)) * 1e6, "us")}

    def outright(
        self, misfit: float, setting: Setting
    ) -> Iterable[tuple[tuple[float, float, float, float], Sequence[Term]]]:
        if misfit < LARGE_MISFIT:
            return
        delay, *others = self.terms(setting)
        for periods in LARGE_DELAYS:
            late = periods * setting.facts.sample_period_s
            for start in impedance_starts(setting.record, late):
                yield start, (replace(delay, start=late), *others)

    def rivals(self, model: Model, absent: Collection[str]) -> Iterable[tuple[str, Model]]:
        if model.of(self.name).get(EARLY.symbol, 0.0) < 0.0 and CONDUCTANCE.effect in absent:
            yield CONDUCTANCE.effect, shown_at_its_instant(model)

    def words_for(self, sizes: Mapping[str, float]) -> Words:
        return self.read_late if sizes.get("delay_us", 0.0) < 0.0 else self.words

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        """The simulator cannot read ahead: a current that is read late is read at its instant there."""
        return {"size": max(1e-6 * sizes["delay_us"], 0.0)}


CAUSE = SamplingDelay()
