"""Lag of the current sensors."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace

import numpy as np

from commissioner.diagnose.causes.cause import (
    FINE,
    READ_BOTH,
    SAME,
    AsOne,
    Cause,
    Confounder,
    Entry,
    Procedure,
    Proposal,
    Standing,
    Words,
)
from commissioner.diagnose.causes.sampling.sampling_delay import CAUSE as DELAYED
from commissioner.diagnose.causes.sampling.sampling_delay import LATE
from commissioner.diagnose.causes.setting import Numbers, Setting, Sizes
from commissioner.diagnose.intake.record import Facts
from commissioner.diagnose.kernels.kinds import DELAY, LAG
from commissioner.diagnose.plant.model import Model, Term
from commissioner.diagnose.plant.sampling import RIPPLED, SHAPE

MOST_RESONANT = 0.5
FIRST_RIPPLED = 0.07
"""Of a sample, where the fit of a lag that sees the ripple begins: from none there is no way to it, a short one hardly shows."""
LEAST_SHAPE = 0.02
"""Of a lag, from which on it may be a delay of 2 % of it, and a lag of first order."""
CABLE = "cable_capacitance"
HIGH = 0.4
TOGETHER = AsOne(
    Words("The current comes {size} late (sampling delay or sensor lag)", FINE, measurement=LATE),
    {"delay_us": "delay in all", "time_constant_us": "delay in all"},
)


def with_a_high_tone(facts: Facts) -> Procedure:
    return Procedure(
        (
            f"Add one tone near {HIGH / facts.sample_period_s:.0f} Hz (0.4 of the sampling rate) to the test signal.",
            f"Record one of the tests again. {SAME}",
            READ_BOTH,
        ),
        changes_values="Hardly. The motor values follow from the delay in all, and that is known.",
    )


class SensorLag(Cause):
    """Sum S >= 0 [s] of the time constants of 1 / (1 + s S + s² q S²) and its shape q: 0 one lag, 1/4 two equal ones, 1/2
    Butterworth's; of a current without ripple, or of one that ripples with the inverter's pulses (`ripple`). The size is the sum.
    """

    name = "sensor_lag"
    place = 17
    title = "Lag of the current sensors"
    family = "linear"
    sign = 1
    makes_late = True
    signature = "phase and a roll-off with the square of frequency at excited lines, no distortion"
    source = "anti-alias filter or sensor bandwidth: tau dy/dt = i - y, once or twice"
    confounders = (
        # currents are taken as straight between the samples
        Confounder("sampling_delay", tied_share=1e-5, told_apart_by=with_a_high_tone, as_one=TOGETHER),
        Confounder("iron_loss", least_share=5e-4),
        Confounder("rotor_skin_effect"),
    )
    split_by = "lines closer to half the sampling rate, or a loop-back test of the sensor"
    decides = "Add a tone near 0.4 of the sampling rate."
    either = (("lag", "shape"), ("rippled", "shape"))
    words = Words(
        "The current sensors are slow by {size}", FINE, measurement="Check the filters of the current inputs."
    )
    advice = "Normal where it is a part of a sample period."

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        rippled = FIRST_RIPPLED * setting.facts.sample_period_s
        return (
            Term(self.name, "lag", "s", LAG, 0, 1e-6, 0.0, 0.02),
            Term(self.name, "shape", "1", LAG, SHAPE, 1e-2, 0.0, MOST_RESONANT),
            Term(self.name, "rippled", "s", LAG, RIPPLED, 1e-6, 0.0, 0.02, start=rippled),
        )

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        """The sum, and how much of it a delay before a lag of first order may be, whose second order is the same."""
        lag = values.get("lag", 0.0) + values.get("rippled", 0.0)
        sizes = {"time_constant_us": (lag * 1e6, "us")}
        if (shape := values.get("shape", 0.0)) > LEAST_SHAPE and not values.get("rippled"):
            sizes["may_be_delay_us"] = (lag * 1e6 * (1.0 - max(1.0 - 2.0 * shape, 0.0) ** 0.5), "us")
        return sizes

    def occasion(self, accepted: Sequence[Cause], names: Collection[str]) -> frozenset[str] | None:
        late = frozenset(c.name for c in accepted if c.makes_late)
        return late if (CABLE in late and self.name in names) or late == {self.name} else None

    def proposals(self, here: Standing) -> Iterable[tuple[Proposal, ...]]:
        return self._smooth(here) if CABLE in here.accepted else self._as_a_delay(here)

    def in_place_of(self, fresh: str, here: Standing) -> Iterable[tuple[Proposal, ...]]:
        """A lag that sees the switching's ripple in place of the delay or the smooth lag that imitates it: at zero nothing promises one."""
        is_smooth = fresh == self.name or self.name not in here.accepted
        if fresh not in (DELAYED.name, self.name, CABLE) or self.name not in here.names or not is_smooth:
            return
        form = self.forms(self.terms(here.setting))[-1]
        numbers = len(form) - len(here.model.of(fresh))
        yield (
            Proposal(
                here.model.without(fresh).with_terms(form),
                (fresh,),
                (self.name,),
                -here.rules.required_chi2(max(numbers, 0)),
                f"a lag that sees the ripple in place of {fresh}",
                lambda _: True,
            ),
        )

    def _smooth(self, here: Standing) -> Iterable[tuple[Proposal, ...]]:
        """A lag, alone or with a delay, in place of the delay and the cable that imitate it.

        At zero a lag is a delay: that it takes amplitude as well shows in second order only, which nothing promises.
        """
        mine = tuple(n for n in here.accepted if n in (DELAYED.name, self.name, CABLE))
        model, rules = here.model, here.rules
        late = model.total(DELAY) + model.total(LAG) or 0.5 * here.setting.facts.sample_period_s
        for name in mine:
            model = model.without(name)
        cost = sum(rules.required_chi2(len(here.model.of(n))) for n in mine)
        for group in ((self,), (DELAYED, self)):
            come = tuple(c.name for c in group)
            if not set(come) <= set(here.names):
                continue
            terms = [t for c in group for t in c.forms(c.terms(here.setting))[0]]
            share = {"lag": 0.7 if len(group) > 1 else 1.0, "delay": 0.3}
            started = model.with_terms(
                [replace(t, start=share[t.symbol] * late) if t.symbol in share else t for t in terms]
            )
            most = cost - sum(rules.required_chi2(sum(t.effect == n for t in terms)) for n in come)
            most -= rules.floor_chi2 if len(group) == len(mine) else 0.0
            yield (Proposal(started, mine, come, most, f"instead of {'+'.join(mine)} {'+'.join(come)}"),)

    def _as_a_delay(self, here: Standing) -> Iterable[tuple[Proposal, ...]]:
        """A delay, one number, in place of a lag and its shape where it is as good by Schwarz' criterion: in the end a filter of any order is one."""
        lag = here.model.of(self.name)
        if (
            not lag.get("shape")
            or lag.get("rippled")
            or DELAYED.name in here.accepted
            or DELAYED.name not in here.names
        ):
            return
        delay = replace(DELAYED.terms(here.setting)[0], start=lag["lag"])
        model = here.model.without(self.name).with_terms([delay])
        says = f"instead of {self.name} and its shape {DELAYED.name}"
        most = float(np.log(here.samples))
        yield (Proposal(model, (self.name,), (DELAYED.name,), most, says, lambda _: True),)

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        """One time constant, or from half of the shape of two equal ones on, those; none that sees a ripple, which the simulator has not."""
        if values.get("rippled"):
            return {}
        shape = "second_order" if values.get("shape", 0.0) > 0.125 else "first_order"
        return {"size": 1e-6 * sizes["time_constant_us"], "shape": shape}


CAUSE = SensorLag()
