"""Dead time of the inverter legs."""

from __future__ import annotations

from collections.abc import Mapping

from commissioner.diagnose.causes.cause import Words
from commissioner.diagnose.causes.inverter.legs import COMPENSATE, HARMLESS, LegLoss
from commissioner.diagnose.causes.setting import Setting, Sizes
from commissioner.diagnose.kernels.kinds import LEGS_LINK
from commissioner.diagnose.plant.model import Term


class DeadTime(LegLoss):
    """v_x = v_x* - (1 + u_x) F(|i_x|) sign(i_x), F a spline over asinh(i) that rises from 0 to V_dt [V >= 0] and stays there, u_x what
    sets the leg apart from the mean of the three. Scales with link voltage times switching frequency where these differ between segments.
    """

    name = "dead_time"
    place = 0
    title = "Dead time of the inverter legs"
    is_common = True
    signature = (
        "each leg loses a voltage with the sign of its own current, largest relative to the command at small "
        "current; odd lines around every tone; leaks into the cross axis off the multiples of 30 degrees"
    )
    source = "J. Holtz, J. Quan, IEEE Trans. Ind. Appl. 38(4), 2002; V_dt = T_d f_sw V_dc per leg"
    words = Words("The inverter's dead time takes {size} from every leg", HARMLESS, COMPENSATE, is_normal=True)

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        return self.numbers(LEGS_LINK, setting)

    def sizes(self, setting: Setting, values: Mapping[str, float]) -> Sizes:
        sizes = dict(super().sizes(setting, values))
        facts = setting.facts
        if facts.switching_frequency_hz and facts.dc_link_v:
            seconds = sizes["voltage_v"][0] / (facts.switching_frequency_hz * facts.dc_link_v)
            sizes["time_us"] = (seconds * 1e6, "us")
        return sizes


CAUSE = DeadTime()
